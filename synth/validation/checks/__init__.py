"""Whether the data set itself is correct: statistical tests of its renders."""
