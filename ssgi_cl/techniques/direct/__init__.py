"""Direct light: punctual lights, shadow maps, ambient light."""
