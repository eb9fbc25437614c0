"""Numpy references of sampled lights."""
