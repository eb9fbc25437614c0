"""Techniques, one module each: ambient occlusion, indirect light, shading, filters."""
