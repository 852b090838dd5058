"""Rendered glossy objects with known ground truth (Mitsuba 3), to test and train the core on.

`scene` describes a scene, `shapes`, `albedos` and `light_rigs` fill it, `rendering` lights it,
`capture` photographs it, `dataset` and `glossy_mit` make data sets, and `validation` measures the
decomposition on them.
"""
