"""Measure how often photos get assumption warnings, rightly and wrongly.

  python -m benchmarks.decomposition.assumption_checks [--world WORLD --panoramas DIR]
  [--batches N] [--photos DIR...] [--data ROOT...] [--weights FILE]

WORLD is a folder of `isc world build`: held-out bodies are lit by held-out panoramas. `--photos`
are folders of photos with masks. `--data` are sets like MIT-Berkeley's: their laboratory photos
with and without gloss. Prints a Markdown table, and below it the photos with warnings.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.decomposition.assumption_checks import check_scene
from isc_core.errors import InputError
from isc_core.networks.scene_network import Kind, SceneNetwork, predict_scene
from isc_core.photo import read_photo
from isc_core.scene.diagnostics import WarningKind

_LAMPS = ("no lamp", "one lamp", "several lamps")
_SIZE = 32  # photos of a batch


@dataclass(frozen=True)
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
    """

    image: np.ndarray
    mask: np.ndarray
    group: str
    name: str = ""


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

    found = read_world([world], panoramas, (Split.BODY,), 0)
    draws = SceneDraws(found.views[Split.BODY], found.atlas, found.judged, _SIZE, Shares())
    draw, rng = SceneBatches(draws, found.bank), np.random.default_rng(0)
    for _ in range(batches):
        sample = draw(rng)
        for k in range(_SIZE):
            kind = list(Kind)[int(sample.kind[k])]
            lamps = _LAMPS[int(sample.count[k])]
            group = f"lit, {lamps}" if kind == Kind.OPAQUE else f"lit, {kind}"
            image = sample.photo[k].permute(1, 2, 0).numpy()
            yield CheckedPhoto(image, sample.mask[k, 0].numpy() > 0, group)


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
    found = [
        {one.kind for one in check_scene(predict_scene(photo.image, photo.mask, network))}
        for photo in photos
    ]
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
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
