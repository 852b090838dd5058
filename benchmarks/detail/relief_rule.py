"""Fit the rule that tells relief from paint by the whole object.

  python -m benchmarks.detail.relief_rule SET --rows FILE [--count N] [--kind KIND]

SET is the validation set of `benchmarks.detail.sets`. Each body is decomposed without fine relief.
What the whole object says, and the relief that its shading explains, scored at several shares, are
stored in a row for each body, so that an interrupted run continues; with `--kind`, rows alone are
made.

Equation: weights w minimise the logistic loss + l |w|^2 / 2 over bodies, l = 1 (the offset is
free). The share of a body's relief that is added is b(p), p its probability by the weights of the
others. Printed are the relief that is then explained and what is invented on print, over the
relief's energy, means over bodies in every octave.

Citation: see `isc_core.shading.relief_evidence`.

Limits: sixty bodies decide three numbers; they have to be tested on others.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.decomposition.detail import Pyramid
from isc_core.decomposition.layers import normals_and_shading
from isc_core.decomposition.models import solve
from isc_core.decomposition.pipeline import WORKING_SIZE
from isc_core.decomposition.settings import MOST_DETAIL, Settings
from isc_core.decomposition.task import DecompositionTask, SceneEstimate, SolveOptions
from isc_core.errors import InputError
from isc_core.photo import read_photo
from isc_core.shading.relief_evidence import ReliefRule, added_share

from .body_rows import body_rows
from .measure import score_relief
from .rendering import SetKind
from .sets import PHOTO, read_truth

SHARES = (0.0, 0.5, 1.0)  # the figures are nearly quadratic in the share
_RIDGE = 1.0
_STEPS = 50


def evidence_and_scores(body: Path) -> dict[str, Any]:
    """Return the evidence for relief of a whole body, and scores of the relief that is added.

    Parameters
    ----------
    body : Path
        Its folder.

    Returns
    -------
    dict of str to Any
        "evidence": two numbers, or None; "explained", "error" and "energy" at each of `SHARES`.
    """
    found, pyramid = _solved(body)
    evidence, relief = pyramid.evidence(), pyramid.relief(MOST_DETAIL)
    truth, scores = read_truth(body), []
    for share in SHARES:
        normal = normals_and_shading(found.height + share * relief, found.light, pyramid.mask)[0]
        scores.append(score_relief(normal, truth.normal, truth.mask, truth.smooth))
    figures = {
        name: [np.asarray(getattr(one, name)).tolist() for one in scores]
        for name in ("explained", "error", "energy")
    }
    return {"evidence": None if evidence is None else list(asdict(evidence).values()), **figures}


def _solved(body: Path) -> tuple[SceneEstimate, Pyramid]:
    """A body without fine relief, and its levels."""
    photo, settings = read_photo(body / PHOTO), Settings(detail=0, threads=1)
    options = SolveOptions(fit_lobe=False, check_assumptions=False)
    working = photo.resized_to_object(WORKING_SIZE)
    found = solve(DecompositionTask(working, photo, settings, options=options))
    return found, Pyramid.of(found.split.diffuse, photo.mask, found.height, found.light)


def logistic_weights(features: np.ndarray, is_relief: np.ndarray) -> np.ndarray:
    """Fit a logistic regression by Newton's method.

    Parameters
    ----------
    features : (n, k) ndarray
    is_relief : (n,) ndarray of bool

    Returns
    -------
    (k + 1,) ndarray
        The offset first.
    """
    inputs = np.column_stack([np.ones(len(features)), features])
    ridge = np.full(inputs.shape[1], _RIDGE)
    ridge[0] = 1e-6
    weights = np.zeros(inputs.shape[1])
    for _ in range(_STEPS):
        shares = 1 / (1 + np.exp(-inputs @ weights))
        curvature = (inputs * (shares * (1 - shares))[:, None]).T @ inputs + np.diag(ridge)
        slope = inputs.T @ (is_relief - shares) - ridge * weights
        weights = weights + np.linalg.solve(curvature, slope)
    return weights


def left_out(features: np.ndarray, is_relief: np.ndarray) -> np.ndarray:
    """Return each body's probability of relief by weights of the others.

    Parameters
    ----------
    features : (n, k) ndarray
    is_relief : (n,) ndarray of bool

    Returns
    -------
    (n,) ndarray
    """
    found = []
    for k in range(len(features)):
        others = np.arange(len(features)) != k
        weights = logistic_weights(features[others], is_relief[others])
        found.append(1 / (1 + np.exp(-weights[0] - features[k] @ weights[1:])))
    return np.array(found)


def figures(
    rows: Sequence[Mapping[str, Any]], probability: np.ndarray, is_relief: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is explained and what is invented.

    Parameters
    ----------
    rows : sequence of mapping
        Of `evidence_and_scores`.
    probability : (n,) ndarray
        Of relief.
    is_relief : (n,) ndarray of bool

    Returns
    -------
    explained, invented : (octaves,) ndarray
    """
    explained, error, energy = (
        np.array([row[name] for row in rows]) for name in ("explained", "error", "energy")
    )
    added = np.array([added_share(p) for p in probability])
    known = _at(explained[is_relief], added[is_relief]).mean(axis=0)
    false = _at(error[~is_relief], added[~is_relief]).mean(axis=0)
    return known, false / energy[is_relief, 0].mean(axis=0)


def _at(values: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Figures (n, octaves) at each body's share by parabolas through (n, SHARES, octaves)."""
    polynomial = np.polynomial.polynomial
    return np.array(
        [
            polynomial.polyval(share, polynomial.polyfit(SHARES, one, 2))
            for share, one in zip(shares, values, strict=True)
        ]
    )


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("folder", type=Path, metavar="SET", help="the validation set of benchmarks.detail.sets")
    add("--rows", type=Path, required=True, metavar="FILE", help="JSON lines to append to")
    add("--kind", type=SetKind, choices=list(SetKind), help="measure one kind of bodies alone")
    add("--count", type=int, help="bodies of each kind")
    given = parser.parse_args()
    kinds = list(SetKind) if given.kind is None else [given.kind]
    rows = []
    try:
        for row in body_rows(
            given.folder, given.rows, kinds, given.count, "rule", evidence_and_scores
        ):
            print(row["body"], np.round(row["explained"], 2).tolist(), flush=True)
            rows.append(row)
    except InputError as error:
        parser.error(str(error))
    if given.kind is None:
        _print_rule([row for row in rows if row["evidence"] is not None])


def _print_rule(rows: Sequence[Mapping[str, Any]]) -> None:
    is_relief = np.array([row["body"].startswith(SetKind.RELIEF) for row in rows])
    features = np.array([row["evidence"] for row in rows])
    probability = left_out(features, is_relief)
    weights = logistic_weights(features, is_relief)
    explained, invented = figures(rows, probability, is_relief)
    print(f"{np.mean((probability > 0.5) == is_relief):.0%} of bodies told, each left out")
    print("explained", np.round(explained, 3), "invented", np.round(invented, 4))
    print(ReliefRule(*(round(float(weight), 2) for weight in weights)))


if __name__ == "__main__":
    main()
