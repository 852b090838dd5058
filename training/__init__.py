"""Programs that fit the networks of `isc_core.networks`.

`training.data` makes the samples, `training.networks` holds one program per network, and
`training.loop` is the loop that all of them run. Needs PyTorch: the extra `training`.
"""
