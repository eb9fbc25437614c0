"""Numpy references of radiosity."""
