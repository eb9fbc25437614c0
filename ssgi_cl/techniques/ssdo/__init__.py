"""Directional occlusion and one-bounce indirect light in screen space."""
