"""Programs that fit the priors of photos to the project's own world: its bodies, paints and
panoramas.

`white_balance` is what a camera does to the light's colour, `panorama_photos` photographs
panoramas, `photographed_bodies` paints and photographs bodies at the size at which SIRFS is
solved, and `photo_priors` is the program. Needs the extras `training` and `synth`.
"""
