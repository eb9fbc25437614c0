"""The rasterizer: G-buffers, shadow maps and layers of scenes."""
