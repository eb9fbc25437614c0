"""Whole frames: parameters, pipelines of passes, the frame graph that runs them, renderer and result."""
