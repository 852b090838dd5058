"""Figures: style, labelled panels, and maps as images."""
