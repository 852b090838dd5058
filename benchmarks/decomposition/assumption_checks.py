"""Measure how often photos get assumption warnings, rightly and wrongly.

  python -m benchmarks.decomposition.assumption_checks [--world WORLD --panoramas DIR]
  [--batches N] [--photos DIR...] [--data ROOT...] [--weights FILE]

WORLD is a folder of `isc world build`: held-out bodies are lit by held-out panoramas. `--photos`
are folders of photos with masks. `--data` are sets like MIT-Berkeley's: their laboratory photos
with and without gloss. Prints a Markdown table, and below it the photos with warnings; for lit
bodies also the area under the ROC curve of each distinction, and how far off the direction of a
single lamp is.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import rankdata

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.decomposition.assumption_checks import check_scene
from isc_core.errors import InputError
from isc_core.networks.scene_network import (
    Kind,
    SceneNetwork,
    ScenePrediction,
    predict_scene,
)
from isc_core.photo import read_photo
from isc_core.scene.diagnostics import WarningKind
from isc_core.scene.light_estimate import PLACES

_LAMPS = ("no lamp", "one lamp", "several lamps")
_SIZE = 32  # photos of a batch


@dataclass(frozen=True, eq=False)
class LitTruth:
    """What is known of a lit body.

    Attributes
    ----------
    kind : Kind
    lamps : int
        None, one, 2 for several.
    toward : (3,) ndarray or None
        Unit vector to the strongest lamp, if there is one.
    """

    kind: Kind
    lamps: int
    toward: np.ndarray | None


@dataclass(frozen=True, eq=False)
class CheckedPhoto:
    """A photo to check.

    Attributes
    ----------
    image : (H, W, 3) ndarray
        Linear.
    mask : (H, W) ndarray of bool
        Pixels of the object.
    group : str
        Row of the table.
    name : str
        Printed if the photo gets a warning; "" for lit bodies.
    truth : LitTruth or None
        Of lit bodies.
    """

    image: np.ndarray
    mask: np.ndarray
    group: str
    name: str = ""
    truth: LitTruth | None = None


def lit(world: Path, panoramas: Path, batches: int) -> Iterator[CheckedPhoto]:
    """Light held-out bodies.

    Parameters
    ----------
    world : Path
        Folder of `isc world build`.
    panoramas : Path
        Folder of panoramas.
    batches : int
        Photos to take, in batches of 32.

    Yields
    ------
    CheckedPhoto
    """
    from training.networks.scene_batches import SceneBatches, SceneDraws, read_world
    from training.world.files import Split
    from training.world.recipes import Shares

    found = read_world([world], panoramas, (Split.UNSEEN_BODY,), 0)
    bodies, held_out = found.views[Split.UNSEEN_BODY], found.held_out_environments
    draws = SceneDraws(bodies, found.atlas, held_out, _SIZE, Shares(), photos=1)
    draw, rng = SceneBatches(draws, found.bank), np.random.default_rng(0)
    for _ in range(batches):
        sample = draw(rng)
        for k in range(_SIZE):
            kind, lamps = list(Kind)[int(sample.kind[k])], int(sample.count[k])
            toward = PLACES[int(sample.place[k])] if lamps else None
            group = f"lit, {_LAMPS[lamps]}" if kind == Kind.OPAQUE else f"lit, {kind}"
            image = sample.photo[k].permute(1, 2, 0).numpy()
            truth = LitTruth(kind, lamps, toward)
            yield CheckedPhoto(image, sample.mask[k, 0].numpy() > 0, group, truth=truth)


def photographed(folder: Path) -> Iterator[CheckedPhoto]:
    """Read the photos of a folder, whose truth is unknown.

    Parameters
    ----------
    folder : Path
        Folder of PNG files; its name becomes the group.

    Returns
    -------
    Iterator of CheckedPhoto
        Sorted by file name.
    """
    for path in sorted(folder.glob("*.png")):
        photo = read_photo(path)
        yield CheckedPhoto(photo.image, photo.mask, folder.name, path.stem)


def laboratory(root: Path) -> Iterator[CheckedPhoto]:
    """Read the laboratory photos of a set like MIT-Berkeley's.

    Parameters
    ----------
    root : Path
        The set.

    Yields
    ------
    CheckedPhoto
        Each object with and without gloss.
    """
    for name in list_objects(root, "laboratory"):
        for kind in ("original", "diffuse"):
            photo = load_object(root, name, "laboratory", kind)
            yield CheckedPhoto(photo.image, photo.valid, f"{root.name}, {kind}", name)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, metavar="DIR", help="panoramas, for --world")
    add("--batches", type=int, default=20, help="of 32 lit photos each (default: %(default)s)")
    add("--photos", type=Path, nargs="+", default=[], metavar="DIR", help="photos with masks")
    add("--data", type=Path, nargs="+", default=[], metavar="ROOT", help="sets of objects")
    add("--weights", type=Path, metavar="NPZ", help="scene network (default: shipped)")
    given = parser.parse_args()
    if given.world and not given.panoramas:
        parser.error("--world needs --panoramas")
    try:
        network = None if given.weights is None else SceneNetwork.read(given.weights)
        report(list(_photos(given)), network or SceneNetwork.shipped())
    except InputError as error:
        parser.error(str(error))


def _photos(given: argparse.Namespace) -> Iterator[CheckedPhoto]:
    if given.world:
        yield from lit(given.world, given.panoramas, given.batches)
    for folder in given.photos:
        yield from photographed(folder)
    for root in given.data:
        yield from laboratory(root)


def report(photos: Sequence[CheckedPhoto], network: SceneNetwork) -> None:
    """Print the table, and the photos with warnings.

    Parameters
    ----------
    photos : sequence of CheckedPhoto
        The photos.
    network : SceneNetwork

    Raises
    ------
    InputError
        If there are no photos.
    """
    if not photos:
        raise InputError("no photos; give --world, --photos or --data")
    scenes = [predict_scene(photo.image, photo.mask, network) for photo in photos]
    found = [{one.kind for one in check_scene(scene)} for scene in scenes]
    lines = [
        "| photos | number | with warnings | mirror or glass | several lights |",
        "|---|---:|---:|---:|---:|",
    ]
    for group in sorted({photo.group for photo in photos}):
        rows = [kinds for kinds, photo in zip(found, photos, strict=True) if photo.group == group]
        shares = [
            np.mean([bool(kinds) for kinds in rows]),
            np.mean([WarningKind.MIRROR_OR_GLASS in kinds for kinds in rows]),
            np.mean([WarningKind.SEVERAL_LIGHTS in kinds for kinds in rows]),
        ]
        cells = " | ".join(f"{share:.1%}" for share in shares)
        lines.append(f"| {group} | {len(rows)} | {cells} |")
    lines.append("")
    for photo, kinds in zip(photos, found, strict=True):
        if photo.name and kinds:
            names = ", ".join(sorted(kind.name.lower().replace("_", " ") for kind in kinds))
            lines.append(f"{photo.group}: {photo.name}: {names}")
    pairs = zip(photos, scenes, strict=True)
    lines += distinctions([(one.truth, scene) for one, scene in pairs if one.truth is not None])
    sys.stdout.write("\n".join(lines) + "\n")


def distinctions(photos: Sequence[tuple[LitTruth, ScenePrediction]]) -> list[str]:
    """Measure how well the network tells kinds of scenes apart.

    Parameters
    ----------
    photos : sequence of (LitTruth, ScenePrediction)

    Returns
    -------
    list of str
        Lines of a Markdown table; empty without photos.
    """
    if not photos:
        return []
    opaque = [(truth, scene) for truth, scene in photos if truth.kind == Kind.OPAQUE]
    areas = {
        "mirror or glass from opaque": roc_area(
            [1 - scene.kinds[0] for _, scene in photos],
            [truth.kind != Kind.OPAQUE for truth, _ in photos],
        ),
        "several lamps from fewer": roc_area(
            [scene.lamps.several for _, scene in opaque], [truth.lamps == 2 for truth, _ in opaque]
        ),
        "no lamp from some": roc_area(
            [scene.lamps.none for _, scene in opaque], [truth.lamps == 0 for truth, _ in opaque]
        ),
    }
    off = [
        np.degrees(np.arccos(np.clip(scene.lamps.direction @ truth.toward, -1, 1)))
        for truth, scene in opaque
        if truth.lamps == 1 and truth.toward is not None
    ]
    return [
        "",
        "| distinction | area under the ROC curve |",
        "|---|---:|",
        *(f"| {name} | {area:.3f} |" for name, area in areas.items()),
        f"| direction of one lamp, median error | {np.median(off):.1f} degrees |",
    ]


def roc_area(scores: Sequence[float], positive: Sequence[bool]) -> float:
    """Return the area under the ROC curve.

    Parameters
    ----------
    scores : sequence of float
        Larger for what is taken for positive.
    positive : sequence of bool

    Returns
    -------
    float
        The share of pairs in the right order, equal scores counting half; NaN without a pair.
    """
    chosen = np.asarray(positive, bool)
    ranks, pairs = rankdata(scores), chosen.sum() * (~chosen).sum()
    least = chosen.sum() * (chosen.sum() + 1) / 2
    return float((ranks[chosen].sum() - least) / pairs) if pairs else float("nan")


if __name__ == "__main__":
    main()
