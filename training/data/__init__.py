"""Samples to fit networks on: rendered, traced and relit objects with known ground truth."""
