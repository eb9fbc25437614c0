"""The occupancy grid: surfaces that block visibility rays."""
