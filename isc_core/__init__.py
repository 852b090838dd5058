"""Intrinsic scene characteristics from one photo of a glossy object."""

__version__ = "0.1.0"
