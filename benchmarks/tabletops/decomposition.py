"""How far off are normals and layers of held-out objects on tables, as people photograph them?

  python -m benchmarks.tabletops.decomposition WORLD --panoramas DIR [--count N] [--seed K]
  [--side N] [--paths N] [--built N] [--json FILE]

WORLD, a folder of `isc world build`, has the patterns. The mask is the true one. Ways to the
normals: `isc decompose`; the scene network alone; the dome that the solver expects inside the
silhouette. Each is measured with the photo's focal length, as in a file of a camera, and without.
The network and the dome know no camera: their normals are turned by the angle between the axis of
the photo and that to the object.

Normals are means of the angle over the object, then over photos, in degrees; intervals are of 95 %
over photos. The specular layer of glossy objects has the squared error of `isc decompose` relative
to that of no specular layer; of matt objects, the share of the light that was taken for specular.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.bootstrap import bootstrap_samples, interval
from isc_core.cli.interface.values import count
from isc_core.decomposition.pipeline import decompose
from isc_core.errors import InputError
from isc_core.evaluation.metrics import angular_error
from isc_core.networks.scene_network import predict_scene
from isc_core.shading.lights import VIEW
from isc_core.shading.perspective import object_axis, rotation_between
from isc_core.sirfs.priors.prior_file import shipped_priors
from isc_core.sirfs.silhouette import silhouette_normals
from training.tabletops.sources import TabletopSources

from .rendering import TabletopPhoto, photos_of

WAYS = ("isc decompose", "network", "dome")
KNOWN, UNKNOWN = "with focal length", "without"


def measured(truth: TabletopPhoto) -> dict[str, float]:
    """Measure one photo.

    Parameters
    ----------
    truth : TabletopPhoto

    Returns
    -------
    dict of str to float
        Degrees for each of `WAYS` with a comma and `KNOWN` or `UNKNOWN`; and "specular", see the
        module, under "glossy" or "matt".
    """
    photo, camera, profile = truth.photo, truth.photo.camera, shipped_priors("photo", 3).silhouette
    assert camera is not None and profile is not None
    mask = photo.mask
    expected = predict_scene(photo.image, mask).normals.normal[mask].astype(float)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True).clip(1e-9)
    dome = silhouette_normals(mask, profile)[mask]
    turn = rotation_between(VIEW, -object_axis(camera, mask))
    results = {
        KNOWN: decompose(photo),
        UNKNOWN: decompose(replace(photo, camera=None)),
    }
    errors: dict[str, float] = {}
    for known, result in results.items():
        axes = turn.T if known == KNOWN else np.eye(3)
        normals = result.normal[mask], expected @ axes, dome @ axes
        for way, normal in zip(WAYS, normals, strict=True):
            angle = angular_error(truth.normal[mask], normal)
            errors[f"{way}, {known}"] = float(np.degrees(angle))
    specular = results[KNOWN].specular[mask]
    if truth.glossy:
        wanted = (photo.image - truth.diffuse)[mask]
        errors["glossy"] = float(np.square(specular - wanted).sum() / np.square(wanted).sum())
    else:
        errors["matt"] = float(specular.sum() / photo.image[mask].sum())
    return errors


def report(rows: list[dict[str, float]]) -> str:
    """Format the errors of several photos.

    Parameters
    ----------
    rows : list of dict
        Of `measured`.

    Returns
    -------
    str
        A Markdown table of the normals, and a line about the specular layers.
    """
    lines = [f"| normals, {len(rows)} photos | {KNOWN} | {UNKNOWN} |", "| --- | --- | --- |"]
    for way in WAYS:
        cells = [_mean([row[f"{way}, {known}"] for row in rows]) for known in (KNOWN, UNKNOWN)]
        lines.append(f"| {way} | {cells[0]} | {cells[1]} |")
    pairs = {
        known: np.array([row[f"{WAYS[0]}, {known}"] - row[f"{WAYS[1]}, {known}"] for row in rows])
        for known in (KNOWN, UNKNOWN)
    }
    cells = [f"{_mean(list(one))}; {(one > 1).sum()} above 1" for one in pairs.values()]
    lines.append(f"| {WAYS[0]} minus {WAYS[1]} | {cells[0]} | {cells[1]} |")
    glossy, matt = ([row[kind] for row in rows if kind in row] for kind in ("glossy", "matt"))
    if glossy:
        lines.append(f"\n{len(glossy)} glossy objects, relative squared error: {_mean(glossy)}")
    if matt:
        lines.append(f"{len(matt)} matt objects, share taken for specular: {_mean(matt)}")
    return "\n".join(lines)


def _mean(values: list[float]) -> str:
    low, high = interval(bootstrap_samples(np.array(values)).mean(axis=1))
    return f"{np.mean(values):.3g} ({low:.3g} to {high:.3g})"


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("world", type=Path, metavar="WORLD", help="folder of isc world build")
    add("--panoramas", type=Path, required=True, metavar="DIR", help="panoramas")
    add("--count", type=count, default=40, help="photos (default: %(default)s)")
    add("--built", type=count, default=4000, help="objects built (default: %(default)s)")
    add("--side", type=count, default=384, help="longer side, pixels (default: %(default)s)")
    add("--paths", type=count, default=64, help="of a pixel (default: %(default)s)")
    add("--seed", type=count, default=0, help="default: %(default)s")
    add("--json", type=Path, help="file to write")
    given = parser.parse_args()
    rows = []
    try:
        with TemporaryDirectory() as folder:
            sources = TabletopSources.read(given.world, given.panoramas, given.built, held_out=True)
            how = given.count, given.side, given.paths, given.seed
            for photo in photos_of(sources, Path(folder), *how):
                rows.append(measured(photo))
                if given.json:
                    given.json.write_text(json.dumps(rows), encoding="utf-8")
    except InputError as error:
        parser.error(str(error))
    print(report(rows))


if __name__ == "__main__":
    main()
