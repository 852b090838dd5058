"""Prediction of a photo's light: the number of its sources, and the direction of the strongest.

Problem: highlights and shadows show people where the light comes from before they know the shape. A
model that recovers the shape first knows the light only as well as its normals, which are 10 to 20
degrees off, so a mirrored direction twice that.

Equation: an encoder of convolutions (`networks.layers`) computes feature maps of the photo; their
roots, averaged in cells of 16 x 16 pixels, and the cell's position on the object, make h = max(0, A
f + a) (n,) of each cell. Mean, deviation and maximum of h over the object make g = max(0, B . + b),
and

    P(sources) = softmax(C g + c),  P(place) = softmax(D g + d),  light, log deviations = E g + e,

averaged over the photo and its mirror image.

Citation: M.-A. Gardner et al., "Learning to predict indoor illumination from a single image", ACM
Trans. Graph. 36(6) (2017), doi:10.1145/3130800.3130891 (a light's direction as a class); O.
Ronneberger, P. Fischer, T. Brox, "U-Net", MICCAI 2015, doi:10.1007/978-3-319-24574-4_28 (the
encoder). Weights, training pictures and loss are our own: `python -m
training.networks.light_network`.

Limits: measured in docs/methods/light_network.md. It was trained on rendered glossy surfaces.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..errors import InputError
from ..scene.light_estimate import PLACES, LightEstimate
from .layers import encoded, is_encoder, softmax
from .loader import Network, Parameters
from .network_input import standardise_input

LONG_SIDE = 112  # of the object in the network's input, in pixels
CELL = 16
_WHERE, _SHADING = 5, 8  # numbers of a cell's position, and of a light's log shading
_LEAST, _MOST = 1e-6, 1e4
_MIN_COVERAGE = (
    0.2  # of the fullest cell's coverage: cells covered less do not enter the maximum of h
)
_LAYERS = ("local", "whole", "lamps", "places", "light")
MIN_LOG_DEVIATION, MAX_LOG_DEVIATION = -3.5, 1.0  # bounds of the logarithm of the deviations
_MIRROR = np.array(
    [1, 1, -1, -1, 1, 1, -1, 1.0]
)  # signs of the log shading's coefficients under reflection


@dataclass(frozen=True)
class LightNetwork(Network):
    """A network for the light. Raises `InputError` where parts do not fit each other.

    Attributes
    ----------
    weights : tuple of (9, inputs, outputs) float32 ndarray
        Of the convolutions, two for each level.
    biases : tuple of (outputs,) float32 ndarray
    middle, scale : (m,) ndarray
        Offset and factor of the cells' features.
    layers : mapping
        Matrix (inputs, outputs) and offset (outputs,) of local, whole, lamps, places and light.
    """

    title = "light network"
    file = "light_network.npz"

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    middle: np.ndarray
    scale: np.ndarray
    layers: Mapping[str, tuple[np.ndarray, np.ndarray]]

    def __post_init__(self) -> None:
        if not (is_encoder(self.weights, self.biases) and self._layers_fit()):
            raise InputError("these are not the weights of a light network")

    def _layers_fit(self) -> bool:
        matrices, added = ([self.layers[name][k] for name in _LAYERS] for k in (0, 1))
        if any(matrix.ndim != 2 for matrix in matrices):
            return False
        count, wide, deep = (
            sum(w.shape[-1] for w in self.weights[1::2]),
            matrices[0].shape[1],
            matrices[1].shape[1],
        )
        expected = [
            (count + _WHERE, wide),
            (3 * wide, deep),
            (deep, 3),
            (deep, len(PLACES)),
            (deep, 2 * _SHADING),
        ]
        fits = [matrix.shape for matrix in matrices] == expected and [
            values.shape for values in added
        ] == [shape[1:] for shape in expected]
        return fits and self.middle.shape == self.scale.shape == (count,)

    @classmethod
    def from_parameters(cls, parameters: Parameters) -> "LightNetwork":
        """Build the network.

        Parameters
        ----------
        parameters : Parameters
            The content of its archive.

        Returns
        -------
        LightNetwork

        Raises
        ------
        InputError, KeyError
            If the parameters do not fit.
        """
        others = parameters.others
        layers = {name: (others[f"{name}_weight"], others[f"{name}_bias"]) for name in _LAYERS}
        return cls(parameters.weights, parameters.biases, others["middle"], others["scale"], layers)

    def __call__(
        self, image: np.ndarray, mask: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Predict the light for an input of `standardise_input`.

        Parameters
        ----------
        image : (H, W, 3) ndarray
        mask : (H, W) bool ndarray

        Returns
        -------
        counts : (3,) ndarray
            Probabilities of no, one and several sources.
        places : (256,) ndarray
            Probabilities of `PLACES`.
        light : (16,) ndarray
            Log shading and its deviations.
        """
        cover = _cells(mask.astype(float)[..., None], CELL)[..., 0]
        steps = iter(zip(self.weights, self.biases, strict=True))
        layers = encoded(image, mask, steps, len(self.weights) // 2)
        features = np.concatenate([_in_cells(layer, cover.shape) for layer in layers], axis=2)
        inside = cover > 0
        weight = cover[inside] / cover.sum()
        normalised = (
            np.sqrt(np.clip(features[inside], 0, _MOST) + _LEAST) - self.middle
        ) * self.scale
        local = self._layer(
            "local",
            np.concatenate([normalised, _cell_positions(inside, weight)], axis=1),
            rectified=True,
        )
        mean = np.einsum("c,cn->n", weight, local)
        spread = np.sqrt(np.maximum(np.einsum("c,cn->n", weight, local**2) - mean**2, _LEAST))
        most = np.where((weight > _MIN_COVERAGE * weight.max())[:, None], local, 0).max(axis=0)
        whole = self._layer("whole", np.concatenate([mean, spread, most])[None], rectified=True)
        counts, places, light = (self._layer(name, whole)[0] for name in _LAYERS[2:])
        return (
            softmax(counts),
            softmax(places),
            np.concatenate(
                [
                    light[:_SHADING],
                    np.exp(np.clip(light[_SHADING:], MIN_LOG_DEVIATION, MAX_LOG_DEVIATION)),
                ]
            ),
        )

    def _layer(self, name: str, values: np.ndarray, rectified: bool = False) -> np.ndarray:
        matrix, added = self.layers[name]
        output = np.einsum("rn,nk->rk", values, matrix) + added
        return np.asarray(np.maximum(output, 0) if rectified else output)


def predict_light(
    image: np.ndarray, mask: np.ndarray, network: LightNetwork | None = None
) -> LightEstimate:
    """Predict the light of a photo: number and direction of its sources, and the log shading.

    Parameters
    ----------
    image : (H, W, 3) ndarray
        Linear, not negative inside the mask.
    mask : (H, W) bool ndarray
    network : LightNetwork, optional
        By default the shipped one.

    Returns
    -------
    LightEstimate
    """
    prepared = standardise_input(image, mask, LONG_SIDE)
    light, cover = prepared.image, prepared.mask
    predict = network or LightNetwork.shipped()
    (counts, places, direct), (mirrored_counts, mirrored_places, reflected) = (
        predict(light, cover),
        predict(light[:, ::-1], cover[:, ::-1]),
    )
    none, one, several = (float(share) for share in (counts + mirrored_counts) / 2)
    shading = (direct[:_SHADING] + _MIRROR * reflected[:_SHADING]) / 2
    return LightEstimate(
        none,
        one,
        several,
        (places + _mirror(mirrored_places)) / 2,
        shading,
        (direct[_SHADING:] + reflected[_SHADING:]) / 2,
    )


def _cells(layer: np.ndarray, step: int) -> np.ndarray:
    """Means of `step` x `step` pixels: (H / step, W / step, C) of (H, W, C)."""
    rows, columns, channels = layer.shape
    return np.asarray(
        layer.reshape(rows // step, step, columns // step, step, channels).mean(axis=(1, 3))
    )


def _in_cells(layer: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """A layer of the encoder on the cells' grid: means, or repeated values if it is coarser."""
    finer = layer.shape[0] // shape[0]
    if finer:
        return _cells(layer.astype(float), finer)
    times = shape[0] // layer.shape[0]
    return np.asarray(layer.astype(float).repeat(times, axis=0).repeat(times, axis=1))


def _cell_positions(inside: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Position of each cell of `inside` (rows, columns) bool, relative to the object's extent:
    x, y, x^2, y^2, x y, (cells, 5).
    """
    rows, columns = np.nonzero(inside)
    offset = np.stack([columns, -rows], axis=1) - np.einsum(
        "c,cd->d", weight, np.stack([columns, -rows], axis=1).astype(float)
    )
    x, y = (offset / np.sqrt(max(float(np.einsum("c,cd->", weight, offset**2)), _LEAST))).T
    return np.stack([x, y, x * x, y * y, x * y], axis=1)


def _mirror(places: np.ndarray) -> np.ndarray:
    """Probabilities of `PLACES` for the mirrored photo."""
    flipped = places[mirrored_places()]
    return np.asarray(flipped / flipped.sum())


@cache
def mirrored_places() -> np.ndarray:
    """Return the number (256,) of the place that mirrors each of `PLACES`."""
    return np.argmax((PLACES * (-1, 1, 1)) @ PLACES.T, axis=1)
