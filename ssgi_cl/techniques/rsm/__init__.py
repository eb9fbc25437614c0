"""Gathering from reflective shadow maps."""
