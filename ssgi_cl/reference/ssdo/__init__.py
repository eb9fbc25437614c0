"""Numpy references of ssdo."""
