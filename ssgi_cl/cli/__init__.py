"""The command line `ssgi`."""
