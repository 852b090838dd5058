"""Photos and masks: reading, linearising, resizing, and finding the object."""
