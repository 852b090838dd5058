"""The stages of a decomposition, each with a way to run it, to score it and to show its result."""
