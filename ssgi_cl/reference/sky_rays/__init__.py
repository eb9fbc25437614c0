"""Numpy references of the light of environments by rays."""
