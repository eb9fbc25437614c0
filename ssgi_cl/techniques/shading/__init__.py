"""Direct and ambient light, shadow maps, tone mapping."""
