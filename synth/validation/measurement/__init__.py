"""Running the stages over a data set, and the statistics of their errors."""
