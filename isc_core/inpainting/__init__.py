"""Filling holes of an image: smoothly (pull-push), or with matched patches."""
