"""The material of an object: its nodes, edits of colour and gloss, and the photo's highlights."""
