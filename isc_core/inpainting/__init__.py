"""Filling holes of an image from its other pixels: smoothly (pull-push), or by patches found
through hashing.
"""
