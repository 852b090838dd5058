"""Patches of surfaces with relief and print, and the fit of the network that tells them apart."""
