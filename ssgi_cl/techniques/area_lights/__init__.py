"""Light of emissive surfaces: exact polygons and shadow rays."""
