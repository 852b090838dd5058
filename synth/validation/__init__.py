"""Validation of the decomposition on rendered scenes: run its stages, measure their errors against
the ground truth, check the data set, and report.
"""
