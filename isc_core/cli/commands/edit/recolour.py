"""`isc edit RESULT recolour`: another reflectance under the same light and gloss."""

import argparse
from pathlib import Path

import numpy as np

from ....editing.clusters import find_clusters
from ....editing.recolour import ColourEdit, recolour
from ....errors import InputError
from ....io.limits import Limits
from ....photo import read_raster
from ....scene.decomposition import Decomposition
from ...interface.options import limits_of
from ...interface.values import count, finite
from .action import ActionResult, EditAction
from .options import add_colour, plain


def _act(d: Decomposition, options: argparse.Namespace) -> ActionResult:
    change = ColourEdit(
        options.hue, options.saturation, options.value, options.color, options.match_brightness
    )
    if options.cluster is not None and options.region is not None:
        raise InputError("--cluster and --region both select pixels: give one of them")
    clusters = find_clusters(d, options.clusters, options.seed)
    region = None
    if options.cluster is not None:
        region = clusters.weight(options.cluster)
    elif options.region is not None:
        region = _read_region(options.region, d, limits_of(options))
    measured = {
        "clusters": [
            {"color": plain(c), "share": float(s)}
            for c, s in zip(clusters.colors, clusters.shares, strict=True)
        ]
    }
    return ActionResult(recolour(d, change, region), measured, (), clusters)


def _read_region(path: Path, d: Decomposition, limits: Limits) -> np.ndarray:
    """The region (H, W) in [0, 1] at the maps' size, from an image of that size or the photo's: its
    alpha channel if that is not opaque; else its values, with 1 as white if none is larger.
    """
    raster = read_raster(path, limits)
    region = raster.transparency
    if region is None:
        codes = np.nan_to_num(raster.values.astype(float), nan=0.0, posinf=1.0, neginf=0.0)
        white = 1.0 if raster.peak is None or codes.max() <= 1 else float(raster.peak)
        region = np.clip(codes.mean(axis=2) / white, 0, 1)
    if region.shape == d.mask.shape:
        return region
    scale, size = d.provenance.input.get("scale"), d.provenance.input.get("size")
    if not isinstance(scale, int | float) or [*region.shape[::-1]] != size:
        raise InputError(
            f"{path}: the region is {region.shape[1]} x {region.shape[0]} pixels: use one of the "
            "photo's size"
        )
    rows, columns = (
        np.clip(((np.arange(n) + 0.5) / scale).astype(int), 0, m - 1)
        for n, m in zip(d.mask.shape, region.shape, strict=True)
    )
    return region[np.ix_(rows, columns)]


def _add_options(parser: argparse.ArgumentParser) -> None:
    defaults = ColourEdit()
    parser.add_argument(
        "--hue", type=finite, default=defaults.hue, metavar="DEGREES", help="rotation of the hue"
    )
    parser.add_argument(
        "--saturation",
        type=finite,
        default=defaults.saturation,
        metavar="F",
        help="factor (default %(default)s)",
    )
    parser.add_argument(
        "--value",
        type=finite,
        default=defaults.value,
        metavar="F",
        help="factor of the brightness (default %(default)s)",
    )
    add_colour(parser, "the new colour, sRGB in hexadecimal; brightness stays the object's")
    parser.add_argument(
        "--match-brightness", action="store_true", help="use the brightness of --colour too"
    )
    parser.add_argument(
        "--region",
        type=Path,
        metavar="FILE",
        help="the pixels to change: an image, white on black, of the photo's size",
    )
    parser.add_argument(
        "--cluster",
        type=count,
        metavar="N",
        help="the pixels to change: cluster N of the object's reflectance, see clusters.png",
    )
    parser.add_argument(
        "--clusters",
        type=count,
        default=4,
        metavar="K",
        help="largest number of clusters (default %(default)s)",
    )
    parser.add_argument(
        "--seed",
        type=count,
        default=0,
        metavar="N",
        help="random seed of the clustering (default %(default)s)",
    )


ACTION = EditAction("recolour", "change the reflectance under the same gloss", _act, _add_options)
