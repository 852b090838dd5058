"""Error metrics and evaluation protocols."""
