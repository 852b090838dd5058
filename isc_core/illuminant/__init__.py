"""The colour of the light."""
