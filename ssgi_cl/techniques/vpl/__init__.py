"""Virtual point lights: choice, packing, splatting and the light tree."""
