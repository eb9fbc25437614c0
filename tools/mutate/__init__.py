"""Mutation testing: change one place of the code, and see the tests that cover it fail."""
