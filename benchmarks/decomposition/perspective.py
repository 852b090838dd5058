"""Does the camera's focal length improve what is recovered? Measured on photos of known bodies.

  python -m benchmarks.decomposition.perspective [--set traced|glossy|rendered] [--count N]
  [--seed K] [--json FILE]

Each body of `perspective_bodies` is decomposed once; its height is read in four ways: as an
orthographic view; from the image plane, from a sphere around the camera, and from the plane that
faces the camera at the object, which is what `isc decompose` does (`shading.perspective`).

Errors: mean angle of the normals in degrees; shape, the RMS distance of the points from the true
ones after the best similarity transform, over the RMS radius, in percent; mean error of log shading
but for its brightness, orthographic and shipped; for `glossy`, the angle between the light of the
lobe fit and the light of the highlight. Tables give means, and the ratio to the orthographic way
with its 95 % interval over bodies.

Limits: at most one light makes a highlight; traced bodies cast no shadows.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.bootstrap import bootstrap_samples, interval
from benchmarks.program import run_program
from isc_core.decomposition.models import DecompositionTask, SceneEstimate, Settings, solve
from isc_core.decomposition.pipeline import assemble
from isc_core.scene.decomposition import Decomposition, Provenance
from isc_core.shading.perspective import lifted_normals, lifted_points, object_axis, ray_offsets
from isc_core.shading.spherical_harmonics import normal_from_reference
from isc_core.shading.surface_stencils import normals

from .perspective_bodies import KINDS, Body, rendered_body, traced_body

WAYS = ("orthographic", "image plane", "sphere", "facing plane")
SETS = ("traced", "glossy", "rendered")
_LEAST = 1e-3  # of the median shading: darker pixels are in the shadow of every light
_FORWARD = np.array([0.0, 0.0, -1.0])


def measured(body: Body, model: str) -> dict[str, list[float]]:
    """Decompose a body.

    Parameters
    ----------
    body : Body
    model : str
        Of `isc decompose`.

    Returns
    -------
    dict of str to list of float
        Errors of normals and shape in the order of `WAYS`, of log shading and of the light of the
        highlight orthographic and as shipped.
    """
    task = DecompositionTask(body.photo, body.photo, Settings(model, threads=1))
    estimate = solve(task)
    flat, lifted = (
        assemble(replace(body.photo, camera=camera), estimate, Provenance())
        for camera in (None, body.camera)
    )
    shapes = [read(body, estimate, way) for way in WAYS]
    mask = body.photo.mask
    return {
        "normals": [_angle(normal[mask], body.normal[mask]) for normal, _ in shapes],
        "shape": [_misfit(points[mask], body.place[mask]) for _, points in shapes],
        "log shading": [_log_error(d, body) for d in (flat, lifted)],
        "light": [_light_error(d, body) for d in (flat, lifted)],
    }


def read(body: Body, estimate: SceneEstimate, way: str) -> tuple[np.ndarray, np.ndarray]:
    """Read the height of an estimate in one way.

    Parameters
    ----------
    body : Body
    estimate : SceneEstimate
    way : str
        One of `WAYS`.

    Returns
    -------
    normal, points : (H, W, 3) ndarray
        Camera frame; the points in any unit.
    """
    height, camera = estimate.height.astype(float), body.camera
    right, down = ray_offsets(camera, (height.shape[0], height.shape[1]))
    if way == "orthographic":
        rows, columns = np.indices(height.shape)
        points = np.stack([columns, -rows, height], axis=-1).astype(float)
        return normal_from_reference(normals(height)), points
    axis = object_axis(camera, body.photo.mask) if way == "facing plane" else _FORWARD
    if way == "sphere":
        height = height + camera.focal_length / 2 * np.log(1 + right**2 + down**2)
    return lifted_normals(height, camera, axis), lifted_points(height, camera, axis)


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    """Mean angle between unit vectors (N, 3), degrees."""
    return float(np.degrees(np.arccos(np.clip((one * other).sum(-1), -1, 1))).mean())


def _misfit(points: np.ndarray, truth: np.ndarray) -> float:
    """RMS distance after the best similarity transform (Umeyama 1991, doi:10.1109/34.88573), over
    the RMS radius; percent.
    """
    points, truth = points - points.mean(0), truth - truth.mean(0)
    left, sizes, right = np.linalg.svd(truth.T @ points)
    sizes[2] *= np.sign(np.linalg.det(left @ right))
    whole, own = (truth**2).sum(), (points**2).sum()
    return float(100 * np.sqrt(max(1 - sizes.sum() ** 2 / (whole * own), 0)))


def _log_error(d: Decomposition, body: Body) -> float:
    lit = d.mask & (body.shading.min(axis=2) > _LEAST * np.median(body.shading[d.mask]))
    off = np.log(d.shading[lit] / body.shading[lit])
    return float(np.abs(off - np.median(off)).mean())


def _light_error(d: Decomposition, body: Body) -> float:
    """Degrees; NaN for matt bodies and where no light was fitted."""
    if not body.light.any() or d.brdf is None or not d.brdf.lights:
        return float("nan")
    return _angle(d.brdf.lights[0].direction[None], body.light[None])


def report(title: str, found: list[dict[str, list[float]]]) -> list[str]:
    """Format the errors of several bodies.

    Parameters
    ----------
    title : str
    found : list of dict
        Of `measured`.

    Returns
    -------
    list of str
        Rows of a Markdown table: set, quantity, and the ways.
    """
    lines = []
    for name in found[0]:
        errors = np.array([one[name] for one in found])
        errors = errors[np.isfinite(errors).all(axis=1)]
        if not len(errors):
            continue
        again = bootstrap_samples(errors, count=4000).mean(axis=1)
        low, high = interval(again / again[:, :1])
        mean = errors.mean(axis=0)
        cells = [f"{mean[0]:.3g}"] + [
            f"{mean[k]:.3g} ({mean[k] / mean[0]:.2f}, {low[k]:.2f}-{high[k]:.2f})"
            for k in range(1, len(mean))
        ]
        cells = [cells[0], *["-"] * (len(WAYS) - len(cells)), *cells[1:]]
        lines.append("| " + " | ".join([title, name, str(len(errors)), *cells]) + " |")
    return lines


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--set", choices=SETS, default="traced", help="default: %(default)s")
    add("--count", type=int, default=8, help="bodies of a kind and place (default: %(default)s)")
    add("--seed", type=int, default=100, help="of the first body (default: %(default)s)")
    add("--json", type=Path, help="file to write")
    given = parser.parse_args()
    kinds = ("Mitsuba",) if given.set == "rendered" else KINDS
    found: dict[str, list[dict[str, list[float]]]] = {}
    for seed in range(given.seed, given.seed + given.count):
        for kind in kinds:
            for aside in (False, True):
                body = (
                    rendered_body(seed, aside)
                    if given.set == "rendered"
                    else traced_body(kind, aside, seed, glossy=given.set == "glossy")
                )
                errors = measured(body, "sirfs" if given.set == "traced" else "joint")
                found.setdefault(f"{kind}, {'aside' if aside else 'centred'}", []).append(errors)
    if given.json:
        given.json.write_text(json.dumps(found), encoding="utf-8")
    print("| bodies | error | n | " + " | ".join(WAYS) + " |\n" + "|---" * (len(WAYS) + 3) + "|")
    everything = [errors for one in found.values() for errors in one]
    for title, rows in [*found.items(), ("all", everything)]:
        print("\n".join(report(title, rows)))


if __name__ == "__main__":
    run_program(main)
