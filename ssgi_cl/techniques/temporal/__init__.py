"""Reuse of earlier frames."""
