"""Numpy references of reflections."""
