"""The passes of a frame, one file each: what a pass reads, writes and runs, as a record (`Stage`)."""
