"""Sequences of frames and sets of views: one function over many files, resumable, on one machine or many."""
