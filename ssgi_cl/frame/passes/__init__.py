"""Passes of a frame, one file each: a function that returns its `Stage`."""
