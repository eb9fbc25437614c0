"""What an operator may do to the library, repeated until something breaks."""
