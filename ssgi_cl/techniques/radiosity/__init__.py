"""Radiosity on surfels: all bounces of all light."""
