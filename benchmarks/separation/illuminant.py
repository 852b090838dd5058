"""How well the light's colour is found, and what it is worth to the separation.

  python -m benchmarks.separation.illuminant SCENES --data ../shared/data -o FILE [--splits train]
  [--colours-only]

Each rendered scene is lit anew: its true diffuse and specular layers are multiplied by 1 + tint (1,
0, -1), in an order drawn by scene, which is what such a light would have made of them exactly. The
laboratory objects stay as they are; their true light is the colour of their specular layer. Errors
are angles in degrees, beside that of calling the light white. Then `isc` separates the photo as it
is, whitened where the colour is determined, whitened always, and whitened by the true colour:
squared error of the diffuse layer over that of doing nothing, geometric mean. A Markdown table.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from isc_core.datasets.highlight_set import SeparationTruth, load_laboratory, load_rendered
from isc_core.datasets.mit_berkeley import list_objects
from isc_core.errors import InputError
from isc_core.illuminant.illuminant import estimate_illuminant, tinted, whitened
from isc_core.io.atomic import new_file
from isc_core.separation import separate

WHITE = np.ones(3)
TINTS = (0.0, 0.05, 0.1, 0.2, 0.5, 0.8)
_TESTS = ("test_objects", "test_materials", "test_lights", "test")
# of the light is specular; below, the light's colour cannot be seen and the tint itself counts as
# true
_GLOSSY = 0.005
_SEED = 5


@dataclass(frozen=True)
class Found:
    """One photo: its `group`; angles in degrees of the estimate and of white; whether it is
    `determined`, and whether it is called `too_strong`; `ratios`: of the separations, as listed
    above, or none.
    """

    group: str
    angle: float
    of_white: float
    determined: bool
    too_strong: bool
    ratios: tuple[float, ...]


def angle(colour: np.ndarray, other: np.ndarray) -> float:
    """Between two colours (3,), in degrees."""
    return float(
        np.degrees(
            np.arccos(
                np.clip(colour @ other / np.linalg.norm(colour) / np.linalg.norm(other), -1, 1)
            )
        )
    )


def relit(truth: SeparationTruth, colour: np.ndarray) -> SeparationTruth:
    """The scene under a light of that colour (3,)."""
    return replace(
        truth,
        image=(truth.image * colour).astype(np.float32),
        diffuse=(truth.diffuse * colour).astype(np.float32),
        specular=(truth.specular * colour).astype(np.float32),
    )


def measure(group: str, truth: SeparationTruth, tint: np.ndarray, colours_only: bool) -> Found:
    """One photo whose light was tinted by `tint` (3,)."""
    specular, image = (
        truth.specular[truth.mask].sum(axis=0, dtype=float),
        truth.image[truth.mask].sum(dtype=float),
    )
    true = 3 * specular / specular.sum() if specular.sum() > _GLOSSY * image else tint
    light = estimate_illuminant(truth.image, truth.mask, truth.clipped)
    ratios: tuple[float, ...] = ()
    if not colours_only and true is not tint:
        as_white = _ratio(truth, WHITE)
        always = _ratio(truth, light.colour)
        ratios = (as_white, always if light.determined else as_white, always, _ratio(truth, true))
    return Found(
        group,
        angle(light.colour, true),
        angle(WHITE, true),
        light.determined,
        light.too_strong,
        ratios,
    )


def _ratio(truth: SeparationTruth, colour: np.ndarray) -> float:
    split = separate("isc", whitened(truth.image, colour), truth.mask, truth.clipped)
    diffuse = tinted(split.diffuse, colour)
    nothing = np.square((truth.image - truth.diffuse)[truth.mask]).sum(dtype=float)
    return float(np.square((diffuse - truth.diffuse)[truth.mask]).sum(dtype=float) / nothing)


def photos(given: argparse.Namespace) -> Iterator[Found]:
    """All of them, each tint a group."""
    folders = [path for split in given.splits for path in sorted((given.scenes / split).glob("*/"))]
    if not folders:
        raise InputError(
            f"{given.scenes} has no scenes in {', '.join(given.splits)}: make some with isc synth"
        )
    for strength in TINTS:
        random = np.random.default_rng(_SEED)
        for folder in folders:
            tint = 1 + strength * random.permutation([1.0, 0, -1])
            yield measure(
                f"rendered, tint {strength:.0%}",
                relit(load_rendered(folder), tint),
                tint,
                given.colours_only,
            )
    objects = given.data / "mit_berkeley_train"
    for name in list_objects(objects, "laboratory"):
        yield measure("laboratory", load_laboratory(objects, name), WHITE, given.colours_only)


def markdown(found: Sequence[Found]) -> str:
    """The table of all groups."""
    lines = [
        "| photos | number | called strongly coloured | angle: estimate / white | largest | determined | their angle / white | largest "
        "| isc as it is | if determined | always | true light |",
        "|---" * 12 + "|",
    ]
    for group in dict.fromkeys(one.group for one in found):
        rows = [one for one in found if one.group == group]
        sure = [one for one in rows if one.determined]
        ratios = np.array([one.ratios for one in rows if one.ratios])
        typical = (
            np.exp(np.log(np.maximum(ratios, 1e-3)).mean(axis=0)) if len(ratios) else np.zeros(0)
        )
        strong = sum(one.too_strong for one in rows)
        cells = [
            group,
            str(len(rows)),
            str(strong),
            _angles(rows),
            f"{max(one.angle for one in rows):.1f}°",
            str(len(sure)),
        ]
        cells += [_angles(sure), f"{max(one.angle for one in sure):.1f}°"] if sure else ["-", "-"]
        cells += [f"{value:.3f}" for value in typical] or ["-"] * 4
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _angles(rows: Sequence[Found]) -> str:
    return f"{np.mean([one.angle for one in rows]):.2f}° / {np.mean([one.of_white for one in rows]):.2f}°"


def main(words: Sequence[str] | None = None) -> None:
    """Measures, prints and writes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", type=Path, help="a folder of isc synth")
    parser.add_argument(
        "--data", type=Path, default=Path("../shared/data"), help="folder with mit_berkeley_train/"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="the table")
    parser.add_argument("--splits", nargs="+", default=list(_TESTS))
    parser.add_argument("--colours-only", action="store_true", help="no separations")
    given = parser.parse_args(words)
    try:
        text = markdown(list(photos(given)))
        with new_file(given.output) as path:
            path.write_text(text, encoding="utf-8")
    except InputError as error:
        parser.error(str(error))
    print(text)


if __name__ == "__main__":
    main()
