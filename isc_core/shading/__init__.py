"""Shading: spherical harmonics, environment maps, surface derivatives and lights."""
