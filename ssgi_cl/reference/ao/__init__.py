"""Numpy references of ao."""
