"""Numpy references of filters."""
