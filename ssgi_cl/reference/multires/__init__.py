"""Numpy references of multires."""
