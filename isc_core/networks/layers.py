"""The inputs and the layers of the networks.

Equation: the input is log(I / mean I + .03) and the mask, in blocks of pixels (space to depth);
each level has two 3 x 3 convolutions with max(0, .) and zero padding, and half the resolution of
the previous one.

Citation: O. Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015,
doi:10.1007/978-3-319-24574-4_28; blocks of pixels: W. Shi et al. 2016, doi:10.1109/CVPR.2016.207.

Limits: those of `convolution`.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from .convolution import convolved, single

DARK = 0.03  # of the mean light: below it, logarithms are dominated by noise
_INFINITY = 0x7C00  # the bits of float16

Steps = Iterator[
    tuple[np.ndarray, np.ndarray]
]  # weights (9, inputs, outputs) and biases (outputs,) of the remaining convolutions


def weights_in(
    data: Mapping[str, np.ndarray],
) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Return the weights and biases of the arrays `weight00`, `bias00`, ...

    Parameters
    ----------
    data : mapping of str to ndarray

    Returns
    -------
    weights : tuple of ndarray
        As they are stored.
    biases : tuple of float32 ndarray

    Raises
    ------
    KeyError
        If one is missing.
    ValueError
        If a number is not finite.
    """
    count = sum(name.startswith("weight") for name in data)
    weights = tuple(data[f"weight{k:02d}"] for k in range(count))
    biases = tuple(data[f"bias{k:02d}"] for k in range(count))
    if not all(map(_is_finite, weights + biases)):
        raise ValueError("some of its values are not finite")
    return weights, tuple(map(single, biases))


def _is_finite(values: np.ndarray) -> bool:
    """Whether all numbers are finite, faster than NumPy for float16."""
    if values.dtype != np.float16 or not values.size:
        return bool(np.isfinite(values.astype(np.float32)).all())
    # Sorted by their bits, infinity and NaN are above all other positive, and negative, numbers.
    bits = values.view(np.int16).max(), values.view(np.uint16).max()
    return bool(bits[0] < _INFINITY and bits[1] < 0x8000 + _INFINITY)


def is_chain(
    weights: tuple[np.ndarray, ...], biases: tuple[np.ndarray, ...], shapes: list[tuple[int, ...]]
) -> bool:
    """Return whether convolutions and biases have these shapes.

    Parameters
    ----------
    weights, biases : tuple of ndarray
    shapes : list of tuple of int
        (9, inputs, outputs) each.

    Returns
    -------
    bool
    """
    return [w.shape for w in weights] == shapes and [b.shape for b in biases] == [
        shape[2:] for shape in shapes
    ]


def inputs_of(image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the channels of the first layer: log light over the object's mean, and the mask.

    Parameters
    ----------
    image : (H, W, 3) ndarray
    mask : (H, W) bool ndarray

    Returns
    -------
    (H, W, 4) float32 ndarray
        Log light is 0 outside the mask.
    """
    light = np.where(mask[..., None], image, 0).astype(np.float32)
    mean = max(float(light.sum(dtype=float)) / (3 * max(int(mask.sum()), 1)), 1e-9)
    log_light = np.log(light / np.float32(mean) + np.float32(DARK)) * mask[..., None]
    return np.concatenate([log_light, mask[..., None].astype(np.float32)], axis=2)


def frame_coordinates(rows: int, columns: int) -> np.ndarray:
    """Return the coordinates of the pixels of a frame.

    Parameters
    ----------
    rows, columns : int

    Returns
    -------
    (rows, columns, 2) float32 ndarray
        Right and up from the centre of the frame, in units of half its side.
    """
    right = ((np.arange(columns) + 0.5) * (2 / columns) - 1).astype(np.float32)
    up = (1 - (np.arange(rows) + 0.5) * (2 / rows)).astype(np.float32)
    return np.stack(np.meshgrid(right, up), axis=2)


def space_to_depth(layers: np.ndarray, block: int) -> np.ndarray:
    """Rearrange each block of pixels into the channels of one pixel.

    Parameters
    ----------
    layers : (N, H, W, C) ndarray
        H and W are multiples of `block`.
    block : int
        Side of a block, b.

    Returns
    -------
    (N, H / b, W / b, b b C) ndarray
        Ordered by channel, then by the row and column of the pixel in its block.
    """
    photos, rows, columns, channels = layers.shape
    blocks = layers.reshape(photos, rows // block, block, columns // block, block, channels)
    return np.ascontiguousarray(blocks.transpose(0, 1, 3, 5, 2, 4)).reshape(
        photos, rows // block, columns // block, block**2 * channels
    )


def depth_to_space(layers: np.ndarray, block: int) -> np.ndarray:
    """Rearrange the channels of each pixel into a block of pixels; inverse of `space_to_depth`.

    Parameters
    ----------
    layers : (N, H, W, b b C) ndarray
    block : int
        Side of a block, b.

    Returns
    -------
    (N, b H, b W, C) ndarray
    """
    photos, rows, columns, channels = layers.shape
    blocks = layers.reshape(photos, rows, columns, channels // block**2, block, block)
    return np.ascontiguousarray(blocks.transpose(0, 1, 4, 2, 5, 3)).reshape(
        photos, block * rows, block * columns, channels // block**2
    )


def conv_block(layers: np.ndarray, steps: Steps) -> np.ndarray:
    """Apply the next two convolutions of `steps`, each followed by max(0, .).

    Parameters
    ----------
    layers : (N, H, W, C) ndarray
    steps : Steps
        Weights and biases of the remaining convolutions; advanced by two.

    Returns
    -------
    (N, H, W, D) float32 ndarray
    """
    for _ in range(2):
        layers = convolved(layers, *next(steps))
        np.maximum(layers, 0, out=layers)
    return layers


def softmax(score: np.ndarray) -> np.ndarray:
    """Convert scores to probabilities.

    Parameters
    ----------
    score : (n,) ndarray

    Returns
    -------
    (n,) ndarray
        They sum to 1.
    """
    shares = np.exp(score - score.max())
    return np.asarray(shares / shares.sum())
