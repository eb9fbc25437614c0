"""Numpy references of vpl."""
