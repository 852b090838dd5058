"""Rendered glossy objects with known ground truth (Mitsuba 3): what the core is tested against."""
