"""Pictures that the mask network learns from: lit bodies pasted before backgrounds."""
