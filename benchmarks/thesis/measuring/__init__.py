"""Measurements shared by items: every run is computed once per output folder and kept there."""
