"""Views as the lighting needs them: cosines to the directions that each pixel sees, in batches.

Equation: `stretched` scales the axes of the camera's frame by A = diag(a, b, s). Affine maps keep
what hides what: a direction l becomes A l / |A l|, a normal A^-1 n / |A^-1 n|, and the solid angle
around l grows by a b s / |A l|^3.

Limits: a stretched body's directions are no longer spread evenly, and fill another cap.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch.nn import functional

from .tensor_batch import TensorBatch
from .views import DIRECTIONS, SIDE, View


@dataclass(frozen=True, eq=False)
class PreparedView:
    """A view as the lighting needs it, N pixels.

    Attributes
    ----------
    name : str
        The body's.
    index : (N,) int64 ndarray
        Pixel of the picture, row by row.
    surface : (N, 10) float32 ndarray
        Normal, place, unit vector to the camera, thickness.
    reached : (N, DIRECTIONS) uint8 ndarray
        Cosine to each direction that sees past the body, times 255.
    directions : (DIRECTIONS, 3) float32 ndarray
    up : (3,) float32 ndarray
        See `View`.
    """

    name: str
    index: np.ndarray
    surface: np.ndarray
    reached: np.ndarray
    directions: np.ndarray
    up: np.ndarray


def prepared(view: View) -> PreparedView:
    """Prepare a view for lighting.

    Parameters
    ----------
    view : View

    Returns
    -------
    PreparedView
    """
    normal = view.normal.astype(np.float32)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    thickness = view.thickness.astype(np.float32)[:, None]
    visible = np.unpackbits(view.visible, axis=1)
    facing = np.rint(255 * np.clip(normal @ view.directions.T, 0, 1)).astype(np.uint8)
    return PreparedView(
        view.name,
        np.flatnonzero(view.mask),
        np.hstack([normal, *_places(view), thickness]).astype(np.float32),
        visible * facing,
        view.directions.astype(np.float32),
        view.up,
    )


@dataclass(frozen=True, eq=False)
class ViewBatch(TensorBatch):
    """B views, their pixels in rows of equal length P; shorter ones are filled up.

    Attributes
    ----------
    index : (B, P) int64 tensor
        Pixel of the picture, row by row; SIDE^2 where filled up.
    normal, position, toward : (B, P, 3) tensor
        Surface normal, place, and unit vector to the camera, in the camera frame.
    thickness : (B, P) tensor
        Length of the ray inside the body.
    reached : (B, P, DIRECTIONS) uint8 tensor
        See `PreparedView`.
    directions : (B, DIRECTIONS, 3) tensor
        Unit.
    solid : (B, DIRECTIONS) tensor
        Solid angle around each direction; 1 where they are spread evenly.
    """

    index: torch.Tensor
    normal: torch.Tensor
    position: torch.Tensor
    toward: torch.Tensor
    thickness: torch.Tensor
    reached: torch.Tensor
    directions: torch.Tensor
    solid: torch.Tensor

    def mean(self, values: torch.Tensor) -> torch.Tensor:
        """Average values over the pixels of each view, without those that are filled up.

        Parameters
        ----------
        values : (B, P, C) tensor

        Returns
        -------
        (B, 1, C) tensor
        """
        own = (self.index < SIDE * SIDE)[..., None].to(values.dtype)
        return (values * own).sum(1, keepdim=True) / own.sum(1, keepdim=True).clamp(min=1)


def batch_of(views: Sequence[PreparedView]) -> ViewBatch:
    """Collect views.

    Parameters
    ----------
    views : sequence of PreparedView

    Returns
    -------
    ViewBatch
        On the CPU.
    """
    return padded_views([_alone(view) for view in views])


def _alone(view: PreparedView) -> ViewBatch:
    """A batch of one view, which shares its memory."""
    surface = torch.from_numpy(view.surface)[None]
    normal, position, toward, thickness = surface.split([3, 3, 3, 1], dim=-1)
    return ViewBatch(
        torch.from_numpy(view.index)[None],
        normal,
        position,
        toward,
        thickness[..., 0],
        torch.from_numpy(view.reached)[None],
        torch.from_numpy(view.directions)[None],
        torch.ones(1, DIRECTIONS),
    )


class ViewStore:
    """Views on the device that lights them.

    Parameters
    ----------
    views : sequence of PreparedView
    device : str
    """

    def __init__(self, views: Sequence[PreparedView], device: str = "cpu") -> None:
        self._views = [_alone(view).to(device) for view in views]

    def batch(self, chosen: torch.Tensor) -> ViewBatch:
        """Collect views.

        Parameters
        ----------
        chosen : (B,) int64 tensor
            Their numbers, on the CPU.

        Returns
        -------
        ViewBatch
            On the device.
        """
        return padded_views([self._views[int(k)] for k in chosen])


def padded_views(views: Sequence[ViewBatch]) -> ViewBatch:
    """Join batches of one view each; what is filled up faces the viewer.

    Parameters
    ----------
    views : sequence of ViewBatch
        On one device.

    Returns
    -------
    ViewBatch
    """

    def padded(name: str, value: float = 0) -> torch.Tensor:
        rows = [getattr(one, name)[0] for one in views]
        return torch.nn.utils.rnn.pad_sequence(rows, True, value)

    index = padded("index", SIDE * SIDE)
    away = (index == SIDE * SIDE).float()[..., None] * index.new_tensor([0.0, 0, 1])
    return ViewBatch(
        index,
        padded("normal") + away,
        padded("position"),
        padded("toward") + away,
        padded("thickness"),
        padded("reached"),
        torch.cat([one.directions for one in views]),
        torch.cat([one.solid for one in views]),
    )


def stretched(views: ViewBatch, factors: torch.Tensor) -> ViewBatch:
    """Scale bodies along the axes.

    Parameters
    ----------
    views : ViewBatch
    factors : (B, 3) tensor
        > 0.

    Returns
    -------
    ViewBatch
        `index` is that of the picture before: it has to be scaled, too.
    """
    scale = factors[:, None]
    directions, toward = views.directions * scale, views.toward * scale
    length = directions.norm(dim=-1)
    directions = directions / length[..., None]
    normal = functional.normalize(views.normal / scale, dim=-1)
    cosine = (normal @ directions.mT).clamp(0, 1)
    reached = (255 * cosine).round().to(torch.uint8) * (views.reached > 0)
    return replace(
        views,
        normal=normal,
        position=views.position * scale,
        toward=functional.normalize(toward, dim=-1),
        thickness=views.thickness * toward.norm(dim=-1),
        reached=reached,
        directions=directions,
        solid=views.solid * factors.prod(1, keepdim=True) / length**3,
    )


def _places(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Positions (N, 3) of a view's pixels and unit vectors (N, 3) from there to the camera."""
    rows, columns = np.nonzero(view.mask)
    across = np.stack([columns + 0.5, SIDE - rows - 0.5], axis=1) * (2 / SIDE) - 1
    depth = view.depth.astype(np.float32)[:, None]
    if np.isinf(view.distance):
        return np.hstack([across, depth]), np.broadcast_to((0.0, 0.0, 1.0), (len(depth), 3))
    position = np.hstack([across * (1 - depth / view.distance), depth])
    toward = np.array([0, 0, view.distance]) - position
    return position, toward / np.linalg.norm(toward, axis=1, keepdims=True)
