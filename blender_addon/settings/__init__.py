"""What the user can set: presets, the properties of a scene, the preferences of the add-on."""
