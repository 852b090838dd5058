"""Rendered pictures of objects that stand on tables, to learn from and to judge.

`python -m training.tabletops` renders them.
"""
