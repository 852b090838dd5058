"""A smooth outline, and a side and a back, for the sheet that a photo shows."""
