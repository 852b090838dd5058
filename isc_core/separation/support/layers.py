"""From a method's specular or diffuse light to the layers of a `Separation`.

Inside the mask 0 <= diffuse <= image, whatever the method returns; `clipped` explains clipped
pixels. Confidence, for methods without their own, is exp(-e / u): e is the expected error of the
specular light, what was removed plus a share of what could still hide in the smallest channel; u is
the mean of the smallest channel over the mask.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...imaging.channels import fade_in, mean_channel, saturation, smallest
from ...imaging.row_blocks import CACHED, row_blocks
from ...scene.decomposition import Separation
from .clipped import explain_clipped

# A highlight can hide in a pixel's smallest channel; the share of it that counts as error where a
# method could decide.
HIDDEN_SHARE = 0.3


def white_layers(
    image: np.ndarray, mask: np.ndarray, specular: np.ndarray, clipped: np.ndarray | None = None
) -> Separation:
    """Build the layers from white specular light, subtracted but never below zero.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    specular : (H, W) ndarray
        Equal in all channels; values that are not finite count as 0.
    clipped : (H, W) bool ndarray, optional

    Returns
    -------
    Separation
        The residual is 0 except where clipped.
    """
    low = smallest(image)
    white = np.where(mask & np.isfinite(specular), np.clip(specular, 0, low), 0).astype(np.float32)
    diffuse = np.where(mask[..., None], np.maximum(image - white[..., None], 0), 0).astype(
        np.float32
    )
    return _separation(image, mask, diffuse, np.repeat(white[..., None], 3, axis=2), clipped)


def bright_layers(
    image: np.ndarray,
    mask: np.ndarray,
    clipped: np.ndarray | None,
    find: Callable[[np.ndarray, np.ndarray, float], np.ndarray],
    *,
    least_saturation: float,
    fade: float | None,
) -> Separation:
    """Build the layers of a method that finds highlights above the mean of the smallest channel.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    clipped : (H, W) bool ndarray or None
    find : callable
        `find(image, linear, base)` returns the specular light (H, W), 0 outside the mask, from the
        pixels `linear` of the mask that are not clipped; `base` is the mean of the smallest
        channel.
    least_saturation : float
        Nothing is removed if the pixels above that mean have less saturation together, in [0, 1].
    fade : float or None
        See `imaging.channels.fade_in`; None for all of it everywhere.

    Returns
    -------
    Separation
    """
    inside = np.where(mask[..., None], image, 0)
    low = smallest(inside)
    base = float(low[mask].mean(dtype=float))
    specular = np.zeros_like(low)
    linear = mask if clipped is None else mask & ~clipped
    if linear.any() and saturation(inside[mask & (low > base)]) >= least_saturation:
        specular = find(inside, linear, base)
        if fade is not None:
            specular = specular * fade_in(low, base, fade)
    return white_layers(inside, mask, specular, clipped)


def diffuse_layers(
    image: np.ndarray, mask: np.ndarray, diffuse: np.ndarray, clipped: np.ndarray | None = None
) -> Separation:
    """Build the layers from a diffuse layer; the specular layer may then be tinted.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray
    diffuse : (H, W, 3) ndarray
        Clamped to [0, image]; values that are not finite count as the image.
    clipped : (H, W) bool ndarray, optional

    Returns
    -------
    Separation
        The residual is 0 except where clipped.
    """
    finite = np.where(np.isfinite(diffuse), diffuse, image)
    kept = np.where(mask[..., None], np.clip(finite, 0, image), 0).astype(np.float32)
    specular = np.where(mask[..., None], np.maximum(image - kept, 0), 0).astype(np.float32)
    return _separation(image, mask, kept, specular, clipped)


def keep_highlights(
    split: Separation, image: np.ndarray, kept: np.ndarray, mask: np.ndarray
) -> Separation:
    """Return layers that are separated in some pixels only; elsewhere all light is diffuse.

    Parameters
    ----------
    split : Separation
        Layers of the image.
    image : (H, W, 3) ndarray
    kept : (H, W) bool ndarray
        Where the layers stay as they are.
    mask : (H, W) bool ndarray

    Returns
    -------
    Separation
        With the same confidence.
    """
    return replace(
        split,
        diffuse=restore_image(split.diffuse, image, kept, mask),
        specular=_restricted(split.specular, kept),
        residual=_restricted(split.residual, kept),
    )


def restore_image(
    diffuse: np.ndarray,
    image: np.ndarray,
    kept: np.ndarray,
    mask: np.ndarray,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Return a diffuse layer that equals the image outside of some pixels.

    Parameters
    ----------
    diffuse, image : (H, W, 3) ndarray
    kept : (H, W) bool ndarray
        Where the diffuse layer stays as it is.
    mask : (H, W) bool ndarray
        The result is 0 outside.
    out : (H, W, 3) ndarray, optional
        Where to write the result; may be `diffuse`.

    Returns
    -------
    (H, W, 3) ndarray
    """
    found = np.empty_like(diffuse) if out is None else out
    for block in row_blocks(mask.shape):
        rows = block.rows
        inside = np.where(mask[rows][..., None], image[rows], 0).astype(diffuse.dtype)
        found[rows] = np.where(kept[rows][..., None], diffuse[rows], inside)
    return found


def _restricted(layer: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """A layer (H, W, 3), 0 outside of `kept`; what is 0 takes no memory until it is written."""
    found = np.zeros_like(layer)
    for block in row_blocks(kept.shape, pixels=CACHED):
        if kept[block.rows].any():
            found[block.rows] = np.where(kept[block.rows][..., None], layer[block.rows], 0)
    return found


def _separation(
    image: np.ndarray,
    mask: np.ndarray,
    diffuse: np.ndarray,
    specular: np.ndarray,
    clipped: np.ndarray | None,
) -> Separation:
    low = np.where(mask, smallest(image), 0)
    base = max(float(low[mask].mean(dtype=float)), 1e-30) if mask.any() else 1.0
    error = mean_channel(specular) + HIDDEN_SHARE * low
    confidence = np.where(mask, np.exp(-error / base), 0).astype(np.float32)
    split = Separation(diffuse, specular, np.zeros_like(diffuse), confidence)
    return split if clipped is None else explain_clipped(split, clipped & mask, mask)
