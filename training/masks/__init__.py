"""Training images of the mask network: cut-outs of rendered objects, pasted before backgrounds."""
