"""Measure how often photos get assumption warnings, rightly and wrongly.

  python -m benchmarks.decomposition.assumption_checks SCENES... [--photos DIR...] [--data ROOT...]
  [--only NAME...] [--classifier FILE] [--light-network FILE]

SCENES are folders of `training.data.rendered_scenes`; of their rigs, one light and then all lights
are switched on. `--photos` are folders of photos with masks. `--data` are sets like MIT-Berkeley's:
their laboratory photos with and without gloss. `--only` keeps these shape families and objects.
Prints a Markdown table, and below it the photos with warnings.
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
from isc_core.networks.light_network import LightNetwork, predict_light
from isc_core.networks.scene_classifier import SceneClassifier, classify_scene
from isc_core.photo import read_photo
from isc_core.scene.diagnostics import WarningKind
from training.data.rendered_scenes import SceneKind, scenes_in


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
        Printed if the photo gets a warning; "" for rendered scenes.
    """

    image: np.ndarray
    mask: np.ndarray
    group: str
    name: str = ""


def rendered(folder: Path, only: Sequence[str]) -> Iterator[CheckedPhoto]:
    """Read the scenes of `training.data.rendered_scenes`.

    Parameters
    ----------
    folder : Path
        Their folder.
    only : sequence of str
        Shape families to keep; empty: all.

    Yields
    ------
    CheckedPhoto
        One per scene, two per rig.
    """
    for scene in scenes_in(folder):
        layers = scene.layers
        if only and scene.shape not in only:
            continue
        if scene.kind == SceneKind.RIG:
            ambient, count = 0.1 * layers[-1], len(layers) - 1
            yield CheckedPhoto(layers[0] + ambient, scene.mask, "rig, one light")
            yield CheckedPhoto(layers[:-1].sum(0) + ambient, scene.mask, f"rig, {count} lights")
        else:
            group = f"{scene.kind.value}, {scene.environment}"
            yield CheckedPhoto(layers.sum(0), scene.mask, group)


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


def laboratory(root: Path, only: Sequence[str]) -> Iterator[CheckedPhoto]:
    """Read the laboratory photos of a set like MIT-Berkeley's.

    Parameters
    ----------
    root : Path
        The set.
    only : sequence of str
        Objects to keep; empty: all.

    Yields
    ------
    CheckedPhoto
        Each object with and without gloss.
    """
    for name in list_objects(root, "laboratory"):
        for kind in ("original", "diffuse"):
            if not only or name in only:
                photo = load_object(root, name, "laboratory", kind)
                yield CheckedPhoto(photo.image, photo.valid, f"{root.name}, {kind}", name)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("scenes", type=Path, nargs="*", help="folders of training.data.rendered_scenes")
    add("--photos", type=Path, nargs="+", default=[], metavar="DIR", help="photos with masks")
    add("--data", type=Path, nargs="+", default=[], metavar="ROOT", help="sets of objects")
    add("--only", nargs="+", default=[], metavar="NAME", help="shapes and objects to keep")
    add("--classifier", type=Path, metavar="NPZ", help="scene classifier (default: shipped)")
    add("--light-network", type=Path, metavar="NPZ", help="light network (default: shipped)")
    arguments = parser.parse_args()
    classifier, lights = arguments.classifier, arguments.light_network
    try:
        report(
            list(_photos(arguments)),
            SceneClassifier.shipped() if classifier is None else SceneClassifier.read(classifier),
            LightNetwork.shipped() if lights is None else LightNetwork.read(lights),
        )
    except InputError as error:
        parser.error(str(error))


def _photos(arguments: argparse.Namespace) -> Iterator[CheckedPhoto]:
    for folder in arguments.scenes:
        yield from rendered(folder, arguments.only)
    for folder in arguments.photos:
        yield from photographed(folder)
    for root in arguments.data:
        yield from laboratory(root, arguments.only)


def report(
    photos: Sequence[CheckedPhoto], classifier: SceneClassifier, lights: LightNetwork
) -> None:
    """Print the table, and the photos with warnings.

    Parameters
    ----------
    photos : sequence of CheckedPhoto
        The photos.
    classifier : SceneClassifier
        Predicts the class of scene.
    lights : LightNetwork
        Predicts the number of lights.

    Raises
    ------
    InputError
        If there are no photos.
    """
    if not photos:
        raise InputError("no photos; give folders of scenes, --photos or --data")
    found = [
        {
            warning.kind
            for warning in check_scene(
                classify_scene(photo.image, photo.mask, classifier),
                predict_light(photo.image, photo.mask, lights),
            )
        }
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
