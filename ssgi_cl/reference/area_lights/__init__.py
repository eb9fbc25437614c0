"""Numpy references of the light of emissive surfaces."""
