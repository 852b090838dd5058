"""Files that Blender and the worker exchange: images on the way out, results on the way back."""
