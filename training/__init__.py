"""Programs that fit the networks of `isc_core.networks`.

`training.world` makes the samples, `training.networks` holds one program per network, and
`training.loop` is the loop that they run. Needs PyTorch: the extra `training`.
"""
