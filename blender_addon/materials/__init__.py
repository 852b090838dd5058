"""The material of an object: its nodes, edits of color and gloss, and the photo's highlights."""
