"""A whole frame: which passes it needs, their order, what is skipped, the renderer."""
