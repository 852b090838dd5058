"""The neural networks: what they predict from a photo, their layers and their weights."""
