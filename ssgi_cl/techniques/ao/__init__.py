"""Ambient occlusion."""
