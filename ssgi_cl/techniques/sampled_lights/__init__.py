"""Light of environments by sampled directions with depth maps."""
