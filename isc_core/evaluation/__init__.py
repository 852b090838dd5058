"""Error metrics and the accuracy protocols."""
