"""Numpy references of the reuse of earlier frames."""
