"""Time and error of techniques over scenes, and the search for parameters."""
