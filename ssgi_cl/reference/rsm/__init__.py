"""Numpy references of rsm."""
