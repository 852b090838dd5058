"""The world that the networks learn from: bodies, colours, lights and cameras."""
