"""Rendered glossy objects with ground truth (Mitsuba 3), for tests and training of the core.

`scene` describes a scene, `shapes`, `albedos` and `light_rigs` generate its content, `rendering`
renders it, `capture` exposes it and simulates the sensor, `dataset` and `glossy_mit` make data
sets, and `validation` evaluates the decomposition on them.
"""
