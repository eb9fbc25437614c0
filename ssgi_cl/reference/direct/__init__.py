"""Numpy references of direct."""
