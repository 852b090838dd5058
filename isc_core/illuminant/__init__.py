"""The colour of the light in a photo, and whether white is among its colours."""

from .illuminant import Illuminant, IlluminantOptions, estimate_illuminant, tinted, whitened

__all__ = ["Illuminant", "IlluminantOptions", "estimate_illuminant", "tinted", "whitened"]
