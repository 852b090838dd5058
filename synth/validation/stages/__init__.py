"""The stages of a decomposition, each with functions to run it, score it and show its result."""
