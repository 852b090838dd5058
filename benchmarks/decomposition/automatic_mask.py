"""How good are masks that are found automatically? Measured on composites of held-out objects.

  python -m benchmarks.decomposition.automatic_mask WORLD --panoramas DIR [--photos DIR]
  [--cut-photos DIR] [--tabletops DIR] [--weights NPZ] [--count N] [--difficult N] [--sheet JPG]
  [--json FILE]

WORLD is a folder of `isc world build`. Part B of `training.masks.held_out`: half of the photos of
one object show bodies that no fit has seen, the other half the masked photos of real objects in
--photos; both stand before crops of panoramas that no fit has seen. As many photos again show
nothing, or several objects. Refusals are wrong where one object is shown, and more so where its
mask would have been right, with an overlap of .5; acceptances where none or several are shown.
--tabletops adds rendered pictures of held-out objects that stand on tables and cast shadows, made
by `python -m training.tabletops --held-out`; some show none or several.
--cut-photos adds held-out photographs of animals, plants and things that somebody has cut out.
--difficult adds photos of one object of each difficult kind, and defocused ones of none. Intervals
are those of resampled photos.

Limits: bodies and panoramas are soft at this size, and the light on an object is not that of its
background. Several photos show the same of the real objects.
"""

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

from benchmarks.bootstrap import cluster_samples, interval
from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.masking.confidence import mask_overlap
from isc_core.masking.refusal import refusal_reason
from isc_core.masking.search import find_mask
from isc_core.networks.mask_network import Count, MaskNetwork
from isc_core.photo.found_mask import FoundMask
from training.masks.difficulty import Difficulty
from training.masks.held_out import (
    HeldOut,
    held_out_composites,
    held_out_cut_photos,
    held_out_ingredients,
    held_out_tabletops,
)
from training.masks.packs import Ingredients

_TILE = 140  # pixels of the sheet's pictures
_SHOWN = 20
_SEED = 5
_RIGHT = 0.5  # overlap of a mask that is right
_WHOLE = 0.7  # overlap of a mask that contains a whole pile
_KINDS = {
    "compound": Difficulty(compound=1),
    "cut by the frame": Difficulty(cut=1),
    "before a defocused background": Difficulty(defocused=1),
    "with bands": Difficulty(banded=1),
}
_NOTHING = "nothing, defocused"
_CUT_PHOTOS = "cut-out photos"
_TABLETOPS = {
    Count.ONE: "on tables",
    Count.NONE: "nothing on tables",
    Count.SEVERAL: "several on tables",
}


@dataclass(frozen=True)
class MaskScore:
    """A composite and what was found in it.

    Attributes
    ----------
    photo : HeldOut
    found : FoundMask
    overlap : float
        Intersection over union; 0 without a truth.
    seconds : float
    """

    photo: HeldOut
    found: FoundMask
    overlap: float
    seconds: float

    @property
    def accepted(self) -> bool:
        """Whether the mask would be used."""
        return not refusal_reason(self.found)

    @property
    def harmful(self) -> bool:
        """Whether it would be used, and is no mask of a whole pile in one piece."""
        pile = self.photo.count == Count.SEVERAL and self.overlap >= _WHOLE
        return self.accepted and not pile


def score_mask(photo: HeldOut, network: MaskNetwork | None) -> MaskScore:
    """Find the mask of a composite, and compare it with the truth.

    Parameters
    ----------
    photo : HeldOut
    network : MaskNetwork or None

    Returns
    -------
    MaskScore
    """
    start = time.perf_counter()
    found = find_mask(photo.light, network=network)
    seconds = time.perf_counter() - start
    return MaskScore(photo, found, mask_overlap(found.mask, photo.cover >= 0.5), seconds)


def report(groups: dict[str, list[MaskScore]]) -> tuple[str, dict[str, object]]:
    """Format the figures.

    Parameters
    ----------
    groups : dict of str to list of MaskScore
        "bodies", "photos", "cut-out photos", the difficult kinds and "on tables" show one object
        each, the others none or several.

    Returns
    -------
    text : str
        A Markdown table.
    figures : dict
    """
    single = [name for name in groups if name in ("bodies", "photos")]
    rows, figures = list[tuple[str, list[MaskScore]]](), dict[str, object]()
    rows += [(name, groups[name]) for name in single]
    rows.append(("all of one object", [one for name in single for one in groups[name]]))
    kinds = (_CUT_PHOTOS, *_KINDS, _TABLETOPS[Count.ONE])
    rows += [(name, groups[name]) for name in kinds if name in groups]
    lines = [
        "| shown | photos | IoU, median | 10th percentile | of those accepted "
        "| refused | refused of right ones |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, found in rows:
        overlap = np.array([one.overlap for one in found])
        kept = np.array([one.accepted for one in found])
        scenes = _scenes(found)
        pairs = [_with_interval(overlap, scenes, q) for q in (0.5, 0.1)]
        accepted = " / ".join(f"{np.quantile(overlap[kept], q):.3f}" for q in (0.5, 0.1))
        right = overlap >= _RIGHT
        refused = f"{_share(~kept, scenes)} | {_share(~kept[right], scenes[right])}"
        lines.append(
            f"| {name} | {len(found)} | {pairs[0]} | {pairs[1]} | {accepted} | {refused} |"
        )
        figures[name] = {
            "overlap": overlap.round(4).tolist(),
            "confidence": [round(one.found.confidence, 4) for one in found],
        }
    lines += ["", "| shown | photos | accepted | of these, no whole piles |", "|---|---|---|---|"]
    others = [name for name in groups if name not in (*single, *kinds)]
    whole = [(name, groups[name]) for name in others]
    apart = (_NOTHING, *_TABLETOPS.values())
    simple = [one for name in others if name not in apart for one in groups[name]]
    whole.append(("no single object, in focus", simple))
    for name, found in whole:
        shares = [
            _share(np.array([getattr(one, key) for one in found]), _scenes(found))
            for key in ("accepted", "harmful")
        ]
        lines.append(f"| {name} | {len(found)} | {shares[0]} | {shares[1]} |")
        figures[name] = {"confidence": [round(one.found.confidence, 4) for one in found]}
    seconds = np.median([one.seconds for found in groups.values() for one in found])
    lines += ["", f"median time of a mask: {seconds:.2f} s"]
    return "\n".join(lines), figures


def _scenes(found: list[MaskScore]) -> np.ndarray:
    """A number (N,) for each photo, equal for photos of one scene."""
    names = [one.photo.scene or f"photo {k}" for k, one in enumerate(found)]
    return np.unique(names, return_inverse=True)[1]


def _with_interval(values: np.ndarray, scenes: np.ndarray, quantile: float) -> str:
    figures = [np.quantile(drawn, quantile) for drawn in cluster_samples(values, scenes.tolist())]
    low, high = interval(np.array(figures))
    return f"{np.quantile(values, quantile):.3f} ({low:.2f}-{high:.2f})"


def _share(chosen: np.ndarray, scenes: np.ndarray) -> str:
    values = chosen.astype(float)
    if not len(values):
        return "-"
    figures = [drawn.mean() for drawn in cluster_samples(values, scenes.tolist())]
    low, high = interval(np.array(figures))
    return f"{values.mean():.1%} ({low:.0%}-{high:.0%})"


def sheet(found: list[MaskScore]) -> Image.Image:
    """Draw photos, true outlines and found covers side by side, two photos a row.

    Parameters
    ----------
    found : list of MaskScore

    Returns
    -------
    PIL.Image.Image
    """
    strips = [_strip(one) for one in found]
    rows = [np.concatenate(strips[k : k + 2], axis=1) for k in range(0, len(strips) - 1, 2)]
    return Image.fromarray(np.concatenate(rows))


def _strip(one: MaskScore) -> np.ndarray:
    """Photo with the true outline in green, photo with the found one in red, the found cover; a
    refused one under a red bar.
    """
    codes = np.rint(255 * linear_to_srgb(np.clip(one.photo.light, 0, 1))).astype(np.uint8)
    tiles = [
        _outlined(codes, one.photo.cover >= 0.5, (0, 255, 0)),
        _outlined(codes, one.found.mask, (255, 0, 0)),
        np.rint(255 * one.found.cover[..., None] * np.ones(3)).astype(np.uint8),
    ]
    strip = np.full((_TILE + 8, 3 * _TILE + 12, 3), 255, np.uint8)
    for k, tile in enumerate(tiles):
        picture = Image.fromarray(tile)
        picture.thumbnail((_TILE, _TILE))
        values = np.asarray(picture)
        strip[4 : 4 + values.shape[0], k * _TILE : k * _TILE + values.shape[1]] = values
    strip[:3, : 3 * _TILE] = (60, 160, 60) if one.accepted else (220, 0, 0)
    return strip


def _outlined(codes: np.ndarray, mask: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    edge = ndimage.binary_dilation(mask, iterations=2) & ~mask
    return np.where(edge[..., None], np.array(colour, np.uint8), codes)


def score_difficult(
    bodies: Ingredients, number: int, network: MaskNetwork | None
) -> dict[str, list[MaskScore]]:
    """Find the masks of difficult composites.

    Parameters
    ----------
    bodies : Ingredients
    number : int
        Of composites of each kind.
    network : MaskNetwork or None

    Returns
    -------
    dict of str to list of MaskScore
        By kind.
    """
    kinds = [(name, Count.ONE, difficulty) for name, difficulty in _KINDS.items()]
    kinds.append((_NOTHING, Count.NONE, Difficulty(defocused=1)))
    return {
        name: [
            score_mask(photo, network)
            for photo in held_out_composites(bodies, count, number, _SEED + 10 + k, difficulty)
        ]
        for k, (name, count, difficulty) in enumerate(kinds)
    }


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--photos", type=Path, metavar="DIR", help="masked photos of real objects")
    add("--cut-photos", type=Path, metavar="DIR", help="photographs with transparent backgrounds")
    add("--without", nargs="*", default=[], metavar="NAME", help="folders of these to leave out")
    add("--tabletops", type=Path, metavar="DIR", help="rendered pictures of objects on tables")
    add("--weights", type=Path, metavar="NPZ", help="mask network (default: the shipped one)")
    add("--count", type=int, default=200, help="photos of one object (default: %(default)s)")
    add("--difficult", type=int, default=0, help="of each difficult kind (default: none)")
    add("--sheet", type=Path, metavar="JPG", help="where to draw 20 of them")
    add("--json", type=Path, help="file to write")
    given = parser.parse_args()
    try:
        network = None if given.weights is None else MaskNetwork.read(given.weights)
        bodies = held_out_ingredients(given.world, given.panoramas, "B")
        objects = {"bodies": bodies}
        if given.photos is not None:
            objects["photos"] = held_out_ingredients(
                given.world, given.panoramas, "B", given.photos
            )
        composed = [
            (name, part, Count.ONE, given.count // len(objects), _SEED + k)
            for k, (name, part) in enumerate(objects.items())
        ]
        half = given.count // 2
        composed.append(("nothing", bodies, Count.NONE, half, _SEED))
        composed.append(("several", bodies, Count.SEVERAL, half, _SEED))
        if given.cut_photos is not None:
            part = held_out_cut_photos(bodies, given.cut_photos, "B", given.without)
            composed.append((_CUT_PHOTOS, part, Count.ONE, half, _SEED))
        folder = given.tabletops
        tabletops = [] if folder is None else list(held_out_tabletops(folder, _SEED))
    except InputError as error:
        parser.error(str(error))
    groups = {
        name: [score_mask(photo, network) for photo in held_out_composites(*rest)]
        for name, *rest in composed
    }
    if given.difficult:
        groups |= score_difficult(bodies, given.difficult, network)
    for photo in tabletops:
        groups.setdefault(_TABLETOPS[photo.count], []).append(score_mask(photo, network))
    text, figures = report(groups)
    print(text)
    if given.json:
        given.json.write_text(json.dumps(figures), encoding="utf-8")
    if given.sheet:
        # the first ones of each kind, whatever was found, but one of each scene on a table
        kinds = [groups[name] for name in objects]
        if on_tables := groups.get(_TABLETOPS[Count.ONE]):
            kinds.append(on_tables[:: max(len(on_tables) // _SHOWN, 1)])
        drawn = [one for found in kinds for one in found[: _SHOWN // len(kinds)]]
        sheet(drawn).save(given.sheet, quality=45)


if __name__ == "__main__":
    main()
