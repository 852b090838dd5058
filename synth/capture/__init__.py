"""From a recipe to a photo with ground truth: `recipe` and `finishes` define the scene, `truth`
renders its layers, `sensor` adds noise, clipping and quantisation.
"""
