"""A textured mesh of a result: its geometry, its textures, and its files as glTF 2.0 binary."""
