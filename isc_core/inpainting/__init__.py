"""Inpainting: smooth (pull-push), or with matched patches."""
