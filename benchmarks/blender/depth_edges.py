"""Can parts in front be cut from the surface behind them?

    python -m benchmarks.blender.depth_edges --panoramas HDRI -o FOLDER

Problem: a step in depth inside the outline becomes a slope, by which a thin part in front is joined
to what is behind. A cut needs to know where the step is, and heights on either side that differ.

Measures, on bodies of known depth (`depth_edge_views`). A step is more than `STEP` of the object's
length between neighbours, at least `_INSIDE` pixels within the outline.

1. How often is a pixel that is called an edge within two pixels of a step, at a given share of the
   steps found (average over that many best pixels)? Asked are the network's depth edges, and a
   logistic regression on them, on height, normals, reflectance and light, fitted on other bodies.
2. How much of a step do the recovered heights have, eight pixels apart across it?
3. What does a cut change from 30 and 60 degrees to either side: PSNR and IoU against the body, lit
   alike and of one colour, of the rounded body, of one cut at the true steps, at the network's
   edges, and both with true heights?

Limits: shading alone; the texture that a slope stretches is not measured.
"""

import argparse
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from benchmarks.program import run_program
from isc_core.numerics.logistic import logistic_weights
from isc_core.result_files.mesh.rim_heights import limit_rim
from isc_core.result_files.solids.back import Back
from isc_core.result_files.solids.rim import Rim
from isc_core.result_files.solids.solid_mesh import SolidMesh, make_solid_mesh
from isc_core.result_files.solids.surface import vertex_normals
from isc_core.result_files.turned_view import View, turned_view

from .cut_bodies import Steps, cut, steps_of
from .depth_edge_views import CHOSEN_ON, REPORTED, SeenBody, seen_bodies
from .side_views import ANGLES, compared

STEP = 0.06
SHARES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
_INSIDE, _NEAR, _ACROSS = 3, 2, 4  # pixels
_LARGE = 0.1  # of the object's length: steps whose heights are compared
_ENOUGH = 0.25  # of the object's length: pixels on steps, for a body to be turned
_EDGE, _LINE = 0.3, 0.1  # probability of an edge, and its length by the object's, for a cut
_SIDE, _FILL = 200, 0.25
_LIGHT = np.array([0.4, 0.6, 0.7]) / np.linalg.norm([0.4, 0.6, 0.7])

Mesh = tuple[np.ndarray, np.ndarray]


def true_steps(body: SeenBody) -> tuple[np.ndarray, np.ndarray]:
    """Return the steps in depth of a body, and where they are looked for.

    Parameters
    ----------
    body : SeenBody

    Returns
    -------
    steps, inside : (H, W) bool ndarray
    """
    inside = ndimage.distance_transform_edt(body.mask) > _INSIDE
    found = steps_of(body.depth, body.mask, STEP * body.length)
    return (found.front | found.behind) & inside, inside


def features(body: SeenBody) -> np.ndarray:
    """Return what may tell a step, (H, W, 9).

    Parameters
    ----------
    body : SeenBody

    Returns
    -------
    ndarray
        Log odds of the network, their sharpness, slopes of height, normals, light and the product
        of each with the odds, depth within the outline.
    """
    odds = np.log(np.clip(body.edge, 1e-4, 1 - 1e-4) / (1 - np.clip(body.edge, 1e-4, 1 - 1e-4)))
    log_light = np.log(np.clip(body.light.mean(-1), 1e-3, None))
    slopes = [
        _slope(np.where(body.mask, body.height, 0)),
        _normal_slope(body),
        _slope(np.where(body.mask, log_light - log_light[body.mask].mean(), 0)),
    ]
    deep = np.log(ndimage.distance_transform_edt(body.mask) / body.length + 0.01)
    sharp = -ndimage.gaussian_laplace(body.edge, 2)
    return np.stack([odds, sharp, *slopes, *(odds * one for one in slopes), deep], -1)


def _slope(plane: np.ndarray) -> np.ndarray:
    return np.asarray(ndimage.gaussian_gradient_magnitude(plane, 1))


def _normal_slope(body: SeenBody) -> np.ndarray:
    planes = (np.where(body.mask, body.normal[..., k], 0) for k in range(3))
    return np.sqrt(np.sum([_slope(plane) ** 2 for plane in planes], axis=0))


def logistic(values: np.ndarray, labels: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Fit a logistic regression on standardised values.

    Parameters
    ----------
    values : (N, K) ndarray
    labels : (N,) bool ndarray

    Returns
    -------
    callable
        From values (M, K) to log odds (M,).
    """
    mean, spread = values.mean(0), values.std(0) + 1e-9

    def design(rows: np.ndarray) -> np.ndarray:
        return np.column_stack([np.ones(len(rows)), (rows - mean) / spread])

    weights = logistic_weights(design(values), labels)
    return lambda rows: np.asarray(design(rows) @ weights)


def _pixels(bodies: Iterable[SeenBody]) -> tuple[np.ndarray, np.ndarray]:
    """Features (N, K) of the pixels within, and whether a step is near (N,)."""
    values, labels = [], []
    for body in bodies:
        steps, inside = true_steps(body)
        values.append(features(body)[inside])
        labels.append(ndimage.binary_dilation(steps, iterations=_NEAR)[inside])
    return np.concatenate(values), np.concatenate(labels)


def precisions(score: np.ndarray, labels: np.ndarray) -> list[float]:
    """Return the share of right pixels among the best, where `SHARES` of the right ones are found.

    Parameters
    ----------
    score : (N,) ndarray
    labels : (N,) bool ndarray

    Returns
    -------
    list of float
    """
    right = np.cumsum(labels[np.argsort(-score, kind="stable")])
    at = np.searchsorted(right, np.array(SHARES) * right[-1])
    return [float(right[k] / (k + 1)) for k in at]


def step_shares(bodies: Iterable[SeenBody]) -> np.ndarray:
    """Return recovered over true differences of height across large steps.

    Parameters
    ----------
    bodies : iterable of SeenBody

    Returns
    -------
    (N,) ndarray
    """
    shares = []
    for body in bodies:
        steps = true_steps(body)[0]
        for axis in (0, 1):
            known, true, found = (
                (np.roll(plane, _ACROSS, axis), np.roll(plane, -_ACROSS, axis))
                for plane in (body.mask, body.depth, body.height)
            )
            across = true[0] - true[1]
            at = steps & known[0] & known[1] & (np.abs(across) > _LARGE * body.length)
            shares.append(((found[0] - found[1])[at] / across[at]).ravel())
    return np.concatenate(shares)


def predicted_steps(body: SeenBody) -> Steps:
    """Return the lines of the network's depth edges; the higher side is that of the heights.

    Parameters
    ----------
    body : SeenBody

    Returns
    -------
    Steps
    """
    inside = true_steps(body)[1]
    line = (body.edge > _EDGE) & (body.edge >= 0.98 * ndimage.maximum_filter(body.edge, 3)) & inside
    labels, _ = ndimage.label(line, np.ones((3, 3)))
    line &= (np.bincount(labels.ravel()) >= _LINE * body.length)[labels] & (labels > 0)
    smooth = ndimage.gaussian_filter(body.height, 1.5)
    front = ndimage.binary_dilation(line, np.ones((3, 3))) & ~line & inside
    above = smooth > ndimage.uniform_filter(smooth, 5)
    crossed = line[:-1, :-1] | line[1:, :-1] | line[:-1, 1:] | line[1:, 1:]
    return Steps(front & above, line, crossed)


def turned(body: SeenBody) -> dict[str, list[float]]:
    """Return PSNR and IoU of meshes from the sides.

    Parameters
    ----------
    body : SeenBody

    Returns
    -------
    dict of str to list of float
        PSNR at 30 and 60 degrees, IoU at 30 and 60 degrees.
    """
    mask, steps = body.mask, steps_of(body.depth, body.mask, STEP * body.length)
    found = limit_rim(body.height, mask, 3)
    rounded, exact = _rounded(body, found), _rounded(body, body.depth)
    meshes = {
        "rounded": _plain(rounded),
        "cut at the true steps": cut(rounded, found, mask, steps),
        "cut at the network's edges": cut(rounded, found, mask, predicted_steps(body)),
        "true heights": _plain(exact),
        "true heights, cut at the true steps": cut(exact, body.depth, mask, steps),
    }
    sides = [sign * yaw for yaw in ANGLES for sign in (-1, 1)]
    truth = {yaw: _view((body.vertices, body.faces), yaw) for yaw in sides}
    rows = {}
    for name, (vertices, faces) in meshes.items():
        middle = np.array(
            [*((np.array(mask.shape[::-1]) - 1) / 2 * (1, -1)), vertices[:, 2].mean()]
        )
        values = [compared(truth[yaw], _view((vertices - middle, faces), yaw)) for yaw in sides]
        rows[name] = [*np.reshape(values, (len(ANGLES), 2, 2)).mean(1).T.ravel()]
    return rows


def _rounded(body: SeenBody, height: np.ndarray) -> SolidMesh:
    cosine = np.ones(body.mask.shape)
    return make_solid_mesh(height, cosine, body.mask, Rim(body.mask), Back.ROUNDED, 0)


def _plain(body: SolidMesh) -> Mesh:
    return np.stack([body.places[:, 1], -body.places[:, 0], body.heights], -1), body.faces


def _view(mesh: Mesh, yaw: float) -> View:
    vertices, faces = mesh
    light = _FILL + (1 - _FILL) * ((1 + vertex_normals(vertices, faces) @ _LIGHT) / 2) ** 2
    seen = turned_view(vertices, faces, light[:, None].repeat(3, 1), yaw, _SIDE, 1.0)
    return replace(seen, values=seen.values * seen.coverage[..., None])


def report(chosen_on: list[SeenBody], reported: list[SeenBody]) -> Iterable[str]:
    """Return the lines of the three measures.

    Parameters
    ----------
    chosen_on, reported : list of SeenBody

    Yields
    ------
    str
    """
    model = logistic(*_pixels(chosen_on))
    values, labels = _pixels(reported)
    yield f"{len(reported)} bodies; {labels.mean():.3f} of the pixels are near a step"
    yield "share of the steps found: " + ", ".join(map(str, SHARES))
    for name, score in (("network's edges", values[:, 0]), ("regression", model(values))):
        yield f"{name}: " + ", ".join(f"{one:.3f}" for one in precisions(score, labels))
    shares = step_shares(reported)
    low, middle, high = np.percentile(shares, (25, 50, 75))
    yield f"recovered share of {len(shares)} steps: {middle:.3f} ({low:.3f} to {high:.3f})"
    yield f"at least half of it: {(shares >= 0.5).mean():.3f}"
    stepped = [one for one in reported if true_steps(one)[0].sum() >= _ENOUGH * one.length]
    rows = [turned(one) for one in stepped]
    base = np.array([one["rounded"] for one in rows])
    yield f"{len(rows)} bodies with steps: PSNR 30, 60, IoU 30, 60; gains with two standard errors"
    for name in rows[0]:
        found = np.array([one[name] for one in rows])
        gain, spread = (found - base).mean(0), 2 * (found - base).std(0, ddof=1) / len(rows) ** 0.5
        gains = ", ".join(f"{g:+.3f} ± {s:.3f}" for g, s in zip(gain, spread, strict=True))
        yield f"{name}: {', '.join(f'{v:.3f}' for v in found.mean(0))}; {gains}"


def main(arguments: list[str] | None = None) -> int:
    """Run the program.

    Parameters
    ----------
    arguments : list of str, optional
        The command line.

    Returns
    -------
    int
        0.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--panoramas", type=Path, required=True)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args(arguments)
    given.output.mkdir(parents=True, exist_ok=True)
    parts = [list(seen_bodies(one, given.output, given.panoramas)) for one in (CHOSEN_ON, REPORTED)]
    for line in report(*parts):
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    run_program(main)
