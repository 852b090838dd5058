"""Statistics that accept or reject: renders against what they should be, and the stages of a
decomposition against the truth.
"""
