"""Reflections of glossy surfaces."""
