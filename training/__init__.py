"""Programs that fit the networks of `isc_core.networks`.

`training.world` makes the samples of the scene network, `training.masks` and `training.tabletops`
those of the mask network. `training.networks` and `training.masks` hold one program per network,
and `training.loop` is the loop that they run. Needs PyTorch: the extra `training`.
"""
