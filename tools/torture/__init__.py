"""Rough use of the library, repeated until something breaks."""
