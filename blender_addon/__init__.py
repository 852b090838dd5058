"""What ISC builds inside Blender: the recovered object, its material, its light and the photo's camera."""
