"""The trainable scene network and its loss; the counterpart of `isc_core.networks.scene_network`.

Equation: with n, y, s the truth at a pixel, m, y', s' the prediction and their scales,

    1.5 |m - n|^2 + .1 (|t - t'|^2 / (4 d^2) + log d)      normals, t their part in the plane
    + .2 (|y - y'| / b + log b)                            log ratio of image and diffuse image
    + .25 (|s - s' - k| / c + log c) + .5 |grad (s - s')|  log shading, k its mean offset
    + .1 |k| + .1 (binary cross entropy of depth edges)
    + .1 (negative log likelihood of the light's 27 numbers, a Gaussian of low rank, over 27)
    + .08, .04 and .1 (cross entropies of the number and the place of lamps, and of the material)

each averaged over the object. Batch normalisation follows each convolution and is folded into it
when the weights are written.

Citation: S. Ioffe, C. Szegedy, "Batch normalization", 2015, arXiv:1502.03167; deviations: A.
Kendall, Y. Gal 2017, arXiv:1703.04977; initial weights: K. He et al. 2015,
doi:10.1109/ICCV.2015.123.

Limits: one deviation for both components of a normal, one scale for three colours.
"""

import math

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from isc_core.errors import InputError
from isc_core.networks.encoder_decoder import BLOCK
from isc_core.networks.layers import DARK
from isc_core.networks.scene_network import (
    CHANNELS,
    COARSE,
    COUNTS,
    FACTOR_SCALE,
    FACTORS,
    GLOBAL,
    HEADS,
    INPUTS,
    KIND_COUNT,
    LIGHT,
    MARGIN,
    MAX_LOG_SCALE,
    MIN_LOG_SCALE,
    PLACE_COUNT,
    TEMPERATURES,
    Head,
)

from ..world.samples import Sample
from .blocks import load_arrays, stored_arrays
from .encoder_decoder import EncoderDecoderModule, start_small

WIDTHS = (64, 160, 256, 384)
HIDDEN = 192


class SceneNetworkModule(EncoderDecoderModule):
    """The trainable scene network.

    Parameters
    ----------
    widths : tuple of int
        Channels of the levels, the finest first.
    """

    def __init__(self, widths: tuple[int, ...] = WIDTHS) -> None:
        super().__init__(INPUTS, CHANNELS, widths, widths[-2::-1], BLOCK)
        self.hidden = nn.Linear(2 * sum(widths[-COARSE:]), HIDDEN)
        self.light = nn.Linear(HIDDEN, GLOBAL)
        nn.init.kaiming_normal_(self.out.weight, nonlinearity="relu")
        start_small(self.out, self.light)
        self.to(memory_format=torch.channels_last)

    def forward(self, inputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Predict maps and light.

        Parameters
        ----------
        inputs : (B, INPUTS, side, side) tensor
            See `network_channels`.

        Returns
        -------
        maps : (B, CHANNELS, side, side) tensor
        vector : (B, GLOBAL) tensor
            As `RawPrediction` describes them.
        """
        maps, levels = self.encoded_and_decoded(inputs)
        cover, features = functional.avg_pool2d(inputs[:, 3:4], BLOCK // 2), []
        for level, layer in enumerate(levels):
            cover = functional.avg_pool2d(cover, 2)
            if level >= len(levels) - COARSE:
                features += _pooled(layer.float(), cover)
        hidden = functional.relu(self.hidden(torch.cat(features, 1)))
        return maps, self.light(hidden)

    def loss(self, batch: Sample) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the loss of a batch and its terms.

        Parameters
        ----------
        batch : Sample

        Returns
        -------
        loss : () tensor
        terms : dict of str to tensor
            Not weighted; "degrees" is the mean angular error.
        """
        maps, vector = self(network_channels(batch.photo, batch.mask))
        maps, batch = _thinned(maps, batch, random=self.training)
        part = {head: maps[:, place] for head, place in HEADS.items()}
        opaque = (batch.kind == 0).float()
        terms = {
            **_normal_terms(part, batch, 0.3 + 0.7 * opaque),
            **_layer_terms(part, batch, opaque),
            "edge": _edge_term(part[Head.EDGE], batch),
            **_light_terms(vector, batch, opaque),
        }
        total = sum(_WEIGHTS[name] * term for name, term in terms.items() if name in _WEIGHTS)
        return total, terms

    @property
    def _dense(self) -> dict[str, nn.Linear]:
        return {"hidden": self.hidden, "light": self.light}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout that the core reads."""
        found = stored_arrays(self.pairs, self.out, self._dense)
        found["temperatures"] = np.ones(len(TEMPERATURES), np.float32)
        return found

    @classmethod
    def of(cls, arrays: dict[str, np.ndarray]) -> "SceneNetworkModule":
        """Build the network of an archive.

        Parameters
        ----------
        arrays : dict of str to ndarray
            As `arrays` returns them.

        Returns
        -------
        SceneNetworkModule

        Raises
        ------
        InputError
            If they are the weights of another network, or none.
        """
        convolutions = sum(name.startswith("weight") for name in arrays)
        levels = (convolutions + 1) // 4
        try:
            network = cls(tuple(arrays[f"weight{2 * k:02d}"].shape[2] for k in range(levels)))
        except (KeyError, IndexError, ValueError) as error:
            raise InputError(f"these are the weights of another network: {error}") from error
        network.load_arrays(arrays)
        return network

    def load_arrays(self, arrays: dict[str, np.ndarray]) -> None:
        """Start from weights in the core's layout.

        The normalisations are taken apart again as the archive keeps them.

        Parameters
        ----------
        arrays : dict of str to ndarray
            Content of an archive.
        """
        load_arrays(self.pairs, self.out, self._dense, arrays)


def network_channels(photo: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Return the input channels; equal to `isc_core.networks.scene_network.channels_of`.

    Parameters
    ----------
    photo : (B, 3, H, W) tensor
    mask : (B, 1, H, W) tensor

    Returns
    -------
    (B, INPUTS, H, W) tensor
    """
    rows, columns = photo.shape[2:]
    right = (torch.arange(columns, device=photo.device) + 0.5) * (2 / columns) - 1
    up = 1 - (torch.arange(rows, device=photo.device) + 0.5) * (2 / rows)
    mean = (photo.mean(1, keepdim=True) * mask).sum((2, 3), keepdim=True)
    mean = (mean / mask.sum((2, 3), keepdim=True).clamp(min=1)).clamp(min=1e-9)
    light = torch.log(photo / mean + DARK) * mask
    return torch.cat([light, mask, right * mask, up[:, None] * mask], 1)


def _thinned(maps: torch.Tensor, batch: Sample, *, random: bool) -> tuple[torch.Tensor, Sample]:
    """Every second row and column: neighbours are correlated, and losses of all pixels would take
    longer than the convolutions.
    """
    row, column = (int(k) for k in torch.randint(2, (2,))) if random else (0, 0)
    parts = {
        name: part[..., row::2, column::2].contiguous() if part.ndim == 4 else part
        for name, part in vars(batch).items()
    }
    return maps[..., row::2, column::2].contiguous(), Sample(**parts)


def _pooled(layer: torch.Tensor, cover: torch.Tensor) -> list[torch.Tensor]:
    weight = cover / cover.sum((2, 3), keepdim=True).clamp(min=1e-6)
    return [(layer * weight).sum((2, 3)), (layer * (2 * cover).clamp(max=1)).amax((2, 3))]


def _mean_over(values: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """Mean of values (B, C, H, W) over pixels of weight (B, 1, H, W); every photo counts alike."""
    total = (values.mean(1, keepdim=True) * weight).sum((1, 2, 3))
    return total / weight.sum((1, 2, 3)).clamp(min=1)


def _normal_terms(
    part: dict[Head, torch.Tensor], batch: Sample, share: torch.Tensor
) -> dict[str, torch.Tensor]:
    error = (part[Head.NORMAL] - batch.normal) ** 2
    log_scale = part[Head.NORMAL_SCALE].clamp(MIN_LOG_SCALE, MAX_LOG_SCALE)
    squared = error[:, :2].mean(1, keepdim=True).detach()
    likelihood = 0.5 * squared * torch.exp(-2 * log_scale) + log_scale
    with torch.no_grad():
        length = part[Head.NORMAL].square().sum(1).sqrt().clamp(min=1e-4)
        cosine = (part[Head.NORMAL] * batch.normal).sum(1) / length
        angle = torch.rad2deg(torch.acos(cosine.clamp(-0.9999, 0.9999)))[:, None]
    return {
        "normal": (3 * _mean_over(error, batch.known) * share).mean(),
        "normal_scale": (_mean_over(likelihood, batch.known) * share).mean(),
        "degrees": _mean_over(angle, batch.known).mean(),
    }


def _layer_terms(
    part: dict[Head, torch.Tensor], batch: Sample, share: torch.Tensor
) -> dict[str, torch.Tensor]:
    ratio = functional.softplus(part[Head.RATIO] - MARGIN)
    ratio_error = (ratio - batch.ratio).abs()
    difference = part[Head.SHADING] - batch.log_shading
    known = batch.known
    offset = _mean_over(difference, known)[:, None, None, None]
    shading_error = (difference - offset).abs()
    steps = torch.zeros_like(offset).flatten()
    for axis in (2, 3):
        size = difference.shape[axis] - 1
        both = known.narrow(axis, 0, size) * known.narrow(axis, 1, size)
        steps = steps + _mean_over(difference.diff(dim=axis).abs(), both)
    whole = share.sum().clamp(min=1)
    return {
        "ratio": (_laplace(ratio_error, part[Head.RATIO_SCALE], known) * share).sum() / whole,
        "shading": (_laplace(shading_error, part[Head.SHADING_SCALE], known) * share).sum() / whole,
        "gradient": (steps * share).sum() / whole,
        "level": (offset.flatten().abs() * share).sum() / whole,
        "ratio_error": (_mean_over(ratio_error, known) * share).sum().detach() / whole,
        "shading_error": (_mean_over(shading_error, known) * share).sum().detach() / whole,
    }


def _laplace(error: torch.Tensor, scale: torch.Tensor, known: torch.Tensor) -> torch.Tensor:
    log_scale = scale.clamp(MIN_LOG_SCALE, MAX_LOG_SCALE)
    return _mean_over(error * torch.exp(-log_scale) + log_scale, known)


def _edge_term(score: torch.Tensor, batch: Sample) -> torch.Tensor:
    entropy = functional.binary_cross_entropy_with_logits(score, batch.edge, reduction="none")
    return _mean_over(entropy, batch.known).mean()


def _light_terms(
    vector: torch.Tensor, batch: Sample, share: torch.Tensor
) -> dict[str, torch.Tensor]:
    sizes = [LIGHT, LIGHT, LIGHT * FACTORS, COUNTS, PLACE_COUNT, KIND_COUNT]
    mean, log_scale, factors, counts, places, kinds = vector.split(sizes, dim=1)
    distance = light_nll(
        batch.light - mean,
        log_scale.clamp(MIN_LOG_SCALE, MAX_LOG_SCALE),
        FACTOR_SCALE * factors.reshape(-1, LIGHT, FACTORS),
    )
    whole = share.sum().clamp(min=1)
    lit = batch.place >= 0
    place = functional.cross_entropy(places, batch.place.clamp(min=0), reduction="none")
    return {
        "light": (distance.clamp(max=20) * share).sum() / whole,
        "count": functional.cross_entropy(counts, batch.count),
        "place": (place * lit).sum() / lit.sum().clamp(min=1),
        "kind": functional.cross_entropy(kinds, batch.kind),
        "light_error": ((mean - batch.light).abs().mean(1) * share).sum().detach() / whole,
    }


def light_nll(error: torch.Tensor, log_scale: torch.Tensor, factors: torch.Tensor) -> torch.Tensor:
    """Return the negative log likelihood of errors for a Gaussian of low rank.

    As `torch.distributions.LowRankMultivariateNormal`, but without synchronising with the device.

    Parameters
    ----------
    error : (B, LIGHT) tensor
    log_scale : (B, LIGHT) tensor
        Of the diagonal part.
    factors : (B, LIGHT, FACTORS) tensor

    Returns
    -------
    (B,) tensor
        Divided by `LIGHT`.
    """
    scale = torch.exp(-log_scale)
    error, factors = error * scale, factors * scale[..., None]
    inner = torch.eye(FACTORS, device=error.device) + factors.mT @ factors
    root = torch.linalg.cholesky_ex(inner).L
    along = torch.linalg.solve_triangular(root, factors.mT @ error[..., None], upper=False)
    squares = error.square().sum(1) - along.square().sum((1, 2))
    volume = 2 * log_scale.sum(1) + 2 * root.diagonal(dim1=1, dim2=2).log().sum(1)
    return 0.5 * (squares + volume + LIGHT * math.log(2 * math.pi)) / LIGHT


_WEIGHTS = {
    "normal": 1.5,
    "normal_scale": 0.1,
    "ratio": 0.2,
    "shading": 0.25,
    "gradient": 0.5,
    "level": 0.1,
    "edge": 0.1,
    "light": 0.1,
    "count": 0.08,
    "place": 0.04,
    "kind": 0.1,
}
