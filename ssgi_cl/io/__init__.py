"""Files and the terminal: OpenEXR, PNG, tables of the commands."""
