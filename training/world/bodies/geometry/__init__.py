"""What the sources of bodies share: welding, orientation, parts, creases."""
