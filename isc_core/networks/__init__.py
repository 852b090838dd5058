"""The neural networks: their predictions from a photo, their layers and their weights."""
