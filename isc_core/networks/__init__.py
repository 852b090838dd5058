"""The neural networks, their layers and their weights."""
