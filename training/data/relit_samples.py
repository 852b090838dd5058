"""Samples of relit objects for the light network and the normal network.

Equation: the photo, the normals and the mask go through one transform: resize, rotate by multiples
of 90 degrees, mirror, place in a square. Normals are averaged over cells of the network's output.

Limits: direction vectors outside the image need `transformed_vectors`.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch.nn import functional

from .augmentation import INSIDE, placed_in_square, simulate_sensor
from .relighting import RelightableObject, RelitPhoto
from .traced_objects import FILL, SIZE

SIDE = 128  # pixels of a training image
OBJECT_SIDE = FILL * SIZE  # pixels: longer side of a traced object


@dataclass(frozen=True)
class Transform:
    """An image transform.

    Attributes
    ----------
    size : tuple of int
        Rows and columns after resizing.
    quarter_turns : int
        Counter-clockwise rotation in units of 90 degrees.
    mirror : bool
        Mirror left and right, after the rotation.
    """

    size: tuple[int, int]
    quarter_turns: int
    mirror: bool


@dataclass(frozen=True)
class RelitSample:
    """A photo with its normals.

    Attributes
    ----------
    image : (3, SIDE, SIDE) tensor
        Linear light of a simulated camera.
    mask : (SIDE, SIDE) tensor
        1 on the object.
    normals : (3, SIDE / cell, SIDE / cell) tensor
        Mean normals of the cells.
    coverage : (1, SIDE / cell, SIDE / cell) tensor
        Share of each cell that the object covers.
    """

    image: torch.Tensor
    mask: torch.Tensor
    normals: torch.Tensor
    coverage: torch.Tensor


def sample_of(
    lit: RelitPhoto,
    relit: RelightableObject,
    transform: Transform,
    cell: int,
    rng: np.random.Generator,
) -> RelitSample:
    """Transform a photo and its normals and simulate the camera.

    Parameters
    ----------
    lit : RelitPhoto
        The photo.
    relit : RelightableObject
        Its object.
    transform : Transform
        The image transform.
    cell : int
        Pixels per cell; divides SIDE.
    rng : np.random.Generator
        Draws the place and the sensor.

    Returns
    -------
    RelitSample
        The photo, its mask and normals.
    """
    normals = np.zeros((*relit.mask.shape, 3), np.float32)
    normals[relit.mask] = relit.normals
    stacked = np.concatenate([lit.photo, normals, relit.mask[..., None]], 2).astype(np.float32)
    layers = functional.interpolate(
        torch.from_numpy(stacked.transpose(2, 0, 1))[None],
        size=transform.size,
        mode="bilinear",
        antialias=True,
        align_corners=False,
    )[0].rot90(transform.quarter_turns, (1, 2))
    layers = layers.flip(2) if transform.mirror else layers
    rows, columns = layers.shape[1:]
    turned = transformed_vectors(layers[3:6].reshape(3, -1).T, transform)
    layers = torch.cat([layers[:3], turned.T.reshape(3, rows, columns), layers[6:]])
    layers = placed_in_square(layers, SIDE, rng)
    mask = (layers[6] > INSIDE).float()
    coverage = functional.avg_pool2d(mask[None], cell)
    cells = functional.avg_pool2d(layers[3:6] * mask, cell) / coverage.clamp(min=1e-3)
    return RelitSample(simulate_sensor(layers[:3], mask, rng), mask, cells, coverage)


def transformed_vectors(vectors: torch.Tensor, transform: Transform) -> torch.Tensor:
    """Apply an image transform to vectors of the camera frame.

    Parameters
    ----------
    vectors : (N, 3) tensor
        x right, y up, z toward the viewer.
    transform : Transform
        Its rotation and mirror are applied.

    Returns
    -------
    (N, 3) tensor
        The vectors in the transformed image.
    """
    for _ in range(transform.quarter_turns):
        vectors = torch.stack([-vectors[:, 1], vectors[:, 0], vectors[:, 2]], 1)
    return vectors * torch.tensor([-1.0, 1, 1]) if transform.mirror else vectors
