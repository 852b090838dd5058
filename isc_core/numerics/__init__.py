"""Deterministic linear algebra, compiled kernels, threads and optimisation."""
