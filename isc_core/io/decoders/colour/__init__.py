"""Colour spaces of image files: ICC profiles, code points, PNG chunks."""
