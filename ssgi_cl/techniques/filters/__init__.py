"""Edge-aware blur and upsampling."""
