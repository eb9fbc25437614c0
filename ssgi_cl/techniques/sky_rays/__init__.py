"""Light of environments by rays against triangles, in enclosed scenes."""
