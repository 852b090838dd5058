"""The colour of the light in a photo, and detection of strongly coloured light."""

from .illuminant import Illuminant, IlluminantOptions, estimate_illuminant, tinted, whitened

__all__ = ["Illuminant", "IlluminantOptions", "estimate_illuminant", "tinted", "whitened"]
