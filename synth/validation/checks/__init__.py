"""Checks of the data set itself: statistical tests of its renders."""
