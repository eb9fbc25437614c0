"""Data of the library: cameras, lights, G-buffers, scenes, parameters, checks. numpy only."""
