"""Figures of README and docs: recorded by `make figures`, and the pages made from them."""
