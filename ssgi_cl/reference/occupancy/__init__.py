"""Numpy references of occupancy."""
