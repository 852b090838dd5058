"""Data sets of rendered scenes: `settings` and `splits` define the scenes of a run, `generate`
renders them, `scene_folder`, `description` and `card` write their files, and `reading` reads them.
"""
