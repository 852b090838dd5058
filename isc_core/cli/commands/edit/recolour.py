"""`isc edit RESULT recolour`: another reflectance under the same light and gloss."""

import argparse
from pathlib import Path

import numpy as np

from ....editing.clusters import find_clusters
from ....editing.recolour import ColourEdit, recolour
from ....errors import InputError
from ....io.limits import Limits
from ....photo import read_raster
from ....scene.part_of_result import ResultPart
from ...interface.options import limits_of
from ...interface.values import count, finite
from .action import ActionResult, EditAction
from .options import add_colour, plain


def _act(stored: ResultPart, options: argparse.Namespace) -> ActionResult:
    change = ColourEdit(
        options.hue, options.saturation, options.value, options.color, options.match_brightness
    )
    if options.cluster is not None and options.region is not None:
        raise InputError("--cluster and --region both select pixels: give one of them")
    d = stored.result
    clusters = find_clusters(d, options.clusters, options.seed)
    region = None
    if options.cluster is not None:
        region = clusters.weight(options.cluster)
    elif options.region is not None:
        region = _read_region(options.region, stored, limits_of(options))
    measured = {
        "clusters": [
            {"color": plain(c), "share": float(s)}
            for c, s in zip(clusters.colors, clusters.shares, strict=True)
        ]
    }
    return ActionResult(recolour(d, change, region), measured, (), clusters)


def _read_region(path: Path, stored: ResultPart, limits: Limits) -> np.ndarray:
    """The region (h, w) in [0, 1] of the maps' part, from an image of the size of their frame or of
    the photo: its alpha channel if that is not opaque; else its values, with 1 as white if none is
    larger.
    """
    raster, part = read_raster(path, limits), stored.part
    height, width = raster.values.shape[:2]
    rows, columns = (np.arange(along.start, along.stop) for along in (part.rows, part.columns))
    if (height, width) != part.shape:
        given = stored.result.provenance.input
        scale = given.get("scale")
        if not isinstance(scale, int | float) or [width, height] != given.get("size"):
            raise InputError(
                f"{path}: the region is {width} x {height} pixels: use one of the photo's size"
            )
        rows, columns = (
            np.clip(((places + 0.5) / scale).astype(int), 0, count - 1)
            for places, count in ((rows, height), (columns, width))
        )
    at = np.ix_(rows, columns)
    if raster.transparency is not None:
        return raster.transparency[at]
    white = 1.0 if raster.peak is None or raster.values.max() <= 1 else float(raster.peak)
    codes = np.nan_to_num(raster.values[at].astype(float), nan=0.0, posinf=1.0, neginf=0.0)
    return np.clip(codes.mean(axis=2) / white, 0, 1)


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
