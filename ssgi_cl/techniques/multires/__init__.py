"""Multiresolution splatting."""
