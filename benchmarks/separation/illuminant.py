"""Measure the estimate of the light's colour, and its value for the separation.

  python -m benchmarks.separation.illuminant SCENES --data ../shared/data -o FILE [--splits train]
  [--colours-only]

Each rendered scene is relit: its true diffuse and specular layers are multiplied by 1 + tint * (1,
0, -1), in an order drawn per scene, which is the exact effect of such a light. The laboratory
objects stay as they are; their true light is the colour of their specular layer. Errors are angles
in degrees, beside the error of assuming white. Then the method `isc` separates the photo as it is,
whitened where the colour is determined, whitened always, and whitened by the true colour: squared
error of the diffuse layer over that of the unchanged photo, geometric mean. Writes a Markdown
table.
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
# Specular share of the light below which the light's colour is not visible, and the tint itself
# counts as true.
_GLOSSY = 0.005
_SEED = 5
_ANGLES = ("angle", "of_white")


@dataclass(frozen=True)
class ColourRow:
    """Result of one photo.

    Attributes
    ----------
    group : str
        Group of photos.
    angle, of_white : float
        Errors of the estimate and of white, in degrees.
    determined, too_strong : bool
        Flags of the estimate.
    ratios : tuple of float
        Error ratios of the four separations, or none.
    """

    group: str
    angle: float
    of_white: float
    determined: bool
    too_strong: bool
    ratios: tuple[float, ...]


def angle(colour: np.ndarray, other: np.ndarray) -> float:
    """Return the angle between two colours.

    Parameters
    ----------
    colour, other : (3,) ndarray
        Linear RGB, not 0.

    Returns
    -------
    float
        In degrees.
    """
    return float(
        np.degrees(
            np.arccos(
                np.clip(colour @ other / np.linalg.norm(colour) / np.linalg.norm(other), -1, 1)
            )
        )
    )


def relit(truth: SeparationTruth, colour: np.ndarray) -> SeparationTruth:
    """Return the scene under a light of the given colour.

    Parameters
    ----------
    truth : SeparationTruth
        The scene under white light.
    colour : (3,) ndarray
        Linear RGB; multiplies the image and its layers.

    Returns
    -------
    SeparationTruth
    """
    return replace(
        truth,
        image=(truth.image * colour).astype(np.float32),
        diffuse=(truth.diffuse * colour).astype(np.float32),
        specular=(truth.specular * colour).astype(np.float32),
    )


def measure(group: str, truth: SeparationTruth, tint: np.ndarray, colours_only: bool) -> ColourRow:
    """Estimate the light's colour of one photo.

    Parameters
    ----------
    group : str
        Group of photos.
    truth : SeparationTruth
        The photo and its layers.
    tint : (3,) ndarray
        Colour that the light was multiplied by.
    colours_only : bool
        Skip the separations.

    Returns
    -------
    ColourRow
        The errors.
    """
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
    return ColourRow(
        group,
        angle(light.colour, true),
        angle(WHITE, true),
        light.determined,
        light.outcome.too_strong,
        ratios,
    )


def _ratio(truth: SeparationTruth, colour: np.ndarray) -> float:
    split = separate("isc", whitened(truth.image, colour), truth.mask, truth.clipped)
    diffuse = tinted(split.diffuse, colour)
    nothing = np.square((truth.image - truth.diffuse)[truth.mask]).sum(dtype=float)
    return float(np.square((diffuse - truth.diffuse)[truth.mask]).sum(dtype=float) / nothing)


def photos(given: argparse.Namespace) -> Iterator[ColourRow]:
    """Measure all photos, one group per tint.

    Parameters
    ----------
    given : argparse.Namespace
        The command's options.

    Yields
    ------
    ColourRow
        One per photo.

    Raises
    ------
    InputError
        If there are no scenes.
    """
    folders = [path for split in given.splits for path in sorted((given.scenes / split).glob("*/"))]
    if not folders:
        raise InputError(
            f"no scenes in {', '.join(given.splits)} of `{given.scenes}`; make some with isc synth"
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


def markdown(found: Sequence[ColourRow]) -> str:
    """Format the rows of all groups as a Markdown table.

    Parameters
    ----------
    found : sequence of ColourRow
        One per photo.

    Returns
    -------
    str
        One line per group.
    """
    lines = [
        "| photos | number | too strongly coloured | angle: estimate / white | largest "
        "| determined | their angle / white | largest "
        "| isc unchanged | if determined | always | true light |",
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


def _angles(rows: Sequence[ColourRow]) -> str:
    estimate, white = (np.mean([getattr(one, name) for one in rows]) for name in _ANGLES)
    return f"{estimate:.2f}° / {white:.2f}°"


def main(words: Sequence[str] | None = None) -> None:
    """Run the command line.

    Parameters
    ----------
    words : sequence of str, optional
        Arguments; by default those of the process.
    """
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", type=Path, help="a run of isc synth")
    parser.add_argument(
        "--data", type=Path, default=Path("../shared/data"), help="folder with mit_berkeley_train/"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="Markdown file to write")
    parser.add_argument("--splits", nargs="+", default=list(_TESTS), help="splits to measure")
    parser.add_argument("--colours-only", action="store_true", help="skip the separations")
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
