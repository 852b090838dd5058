"""Hostile files: every reader is given tens of thousands of damaged ones, and nothing but
`InputError` may come out.
"""
