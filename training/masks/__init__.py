"""Training pictures of the mask network: lit bodies pasted before backgrounds."""
