"""The training data of the networks: bodies, colours, lights and cameras."""
