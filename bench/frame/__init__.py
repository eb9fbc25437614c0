"""Whole frames against path tracing: time, error, and which term the error comes from."""
