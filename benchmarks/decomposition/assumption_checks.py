"""How often a photo is with_warnings that should be, and how often one that should not.

  python -m benchmarks.decomposition.assumption_checks SCENES... [--photos DIR...] [--data ROOT...] [--only NAME...]
      [--appearance FILE] [--lamps FILE]

SCENES: of `python -m training.data.rendered_scenes`. `--photos`: folders of photos with masks; `--data`:
sets like MIT-Berkeley's, their laboratory photos as they are and without gloss. `--only`: those of
these families of shapes and objects of sets. A Markdown table; what is with_warnings of the photos is
named below it. Of "rig" scenes, one lamp and then several are lit.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isc_core.datasets.mit_berkeley import list_objects, load_object
from isc_core.decompose.assumption_checks import check_scene
from isc_core.errors import InputError
from isc_core.networks.light_network import (
    LampNetwork,
    predict_light,
    read_lamp_network,
    shipped_lamp_network,
)
from isc_core.networks.scene_classifier import (
    AppearanceNetwork,
    classify_scene,
    read_appearance,
    shipped_appearance,
)
from isc_core.photo import read_photo
from isc_core.scene.diagnostics import WarningKind
from training.data.rendered_scenes import scenes_in


@dataclass(frozen=True)
class Case:
    """`image` (H, W, 3), `mask` (H, W);

    `group`: of the table; `name`: to be told where it is a photo that is with_warnings, else "".
    """

    image: np.ndarray
    mask: np.ndarray
    group: str
    name: str = ""


def scenes(folder: Path, only: list[str]) -> Iterator[Case]:
    """Those of `training.data.rendered_scenes`."""
    for scene in scenes_in(folder):
        layers = scene.layers
        if only and scene.shape not in only:
            continue
        if scene.kind == "rig":
            yield Case(layers[0] + 0.1 * layers[-1], scene.mask, "rig, one lamp")
            yield Case(
                layers[:-1].sum(0) + 0.1 * layers[-1], scene.mask, f"rig, {len(layers) - 1} lamps"
            )
        else:
            yield Case(layers.sum(0), scene.mask, f"{scene.kind}, {scene.surroundings}")


def photos(folder: Path) -> Iterator[Case]:
    """Photographs, of which nothing is known."""
    for path in sorted(folder.glob("*.png")):
        photo = read_photo(path)
        yield Case(photo.image, photo.mask, folder.name, path.stem)


def laboratory(root: Path, only: list[str]) -> Iterator[Case]:
    """The objects of a set like MIT-Berkeley's."""
    for name in list_objects(root, "laboratory"):
        for kind in ("original", "diffuse"):
            if not only or name in only:
                seen = load_object(root, name, "laboratory", kind)
                yield Case(seen.image, seen.valid, f"{root.name}, {kind}", name)


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", type=Path, nargs="*")
    parser.add_argument("--photos", type=Path, nargs="+", default=[])
    parser.add_argument("--data", type=Path, nargs="+", default=[])
    parser.add_argument("--only", nargs="+", default=[])
    parser.add_argument("--appearance", type=Path, help="another network for mirrors and glass")
    parser.add_argument("--lamps", type=Path, help="another network for several lamps")
    given = parser.parse_args()
    try:
        appearance = (
            shipped_appearance() if given.appearance is None else read_appearance(given.appearance)
        )
        lamps = shipped_lamp_network() if given.lamps is None else read_lamp_network(given.lamps)
        report(list(_cases(given)), appearance, lamps)
    except InputError as error:
        parser.error(str(error))


def _cases(given: argparse.Namespace) -> Iterator[Case]:
    for folder in given.scenes:
        yield from scenes(folder, given.only)
    for folder in given.photos:
        yield from photos(folder)
    for root in given.data:
        yield from laboratory(root, given.only)


def report(cases: list[Case], appearance: AppearanceNetwork, lamps: LampNetwork) -> None:
    """Prints the table, and the warnings of each photo.

    Raises `InputError` where there are none.
    """
    if not cases:
        raise InputError("there is nothing to judge: name folders of scenes, --photos or --data")
    found = [
        [
            warning.kind
            for warning in check_scene(
                classify_scene(case.image, case.mask, appearance),
                predict_light(case.image, case.mask, lamps),
            )
        ]
        for case in cases
    ]
    lines = [
        "| photos | number | with warnings | mirror or glass | several lights |",
        "|---|---:|---:|---:|---:|",
    ]
    for group in sorted({case.group for case in cases}):
        rows = [kinds for kinds, case in zip(found, cases, strict=True) if case.group == group]
        shares = [
            np.mean([bool(kinds) if kind is None else kind in kinds for kinds in rows])
            for kind in (None, WarningKind.MIRROR_OR_GLASS, WarningKind.SEVERAL_LIGHTS)
        ]
        lines.append(
            f"| {group} | {len(rows)} | " + " | ".join(f"{share:.1%}" for share in shares) + " |"
        )
    named = [(case, kinds) for case, kinds in zip(cases, found, strict=True) if case.name and kinds]
    lines += ["", *(f"{case.group}: {case.name}: {'; '.join(kinds)}" for case, kinds in named)]
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
