"""Fit the rule that tells relief from paint, block by block.

  python -m benchmarks.detail.relief_rule SET --rows FILE [--count N]

SET is the validation set of `benchmarks.detail.sets`, of which bodies with relief, with print and
mixed ones are used. Each body is decomposed without fine relief.
The evidence of its blocks, and where there is relief, are stored in a row for each body, so that an
interrupted run continues.

Equation: a block has relief if the mean of 1 - n . n_s over it, n being the true normals and n_s
those of the smooth body, is above .0004 (1.6 degrees). Weights w minimise the logistic loss + l
|w|^2 / 2, l = .1 (the offset is free). The blocks of a body count in proportion to the RMS of their
fine change of log brightness, up to .05, and in total 1. Printed are, for each kind of body, the
log loss and the share of blocks told correctly, by the weights of the other bodies. What is then
explained and invented is measured by `benchmarks.detail.recovered`.

Citation: see `isc_core.shading.relief_evidence`.

Limits: ninety bodies decide three numbers; they have to be tested on others.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from isc_core.decomposition.detail import Pyramid
from isc_core.decomposition.models import solve
from isc_core.decomposition.pipeline import WORKING_SIZE
from isc_core.decomposition.settings import Settings
from isc_core.decomposition.task import DecompositionTask, SolveOptions
from isc_core.errors import InputError
from isc_core.imaging.blocks import block_means
from isc_core.numerics.logistic import logistic_weights
from isc_core.photo import read_photo
from isc_core.shading.relief_evidence import BLOCK, ReliefRule, fine_change

from .body_rows import body_rows
from .rendering import SetKind
from .sets import PHOTO, Truth, read_truth

_KINDS = (SetKind.RELIEF, SetKind.PRINT, SetKind.MIXED)
_RIDGE, _OFFSET_RIDGE = 0.1, 1e-6
_LEAST_RELIEF = 4e-4
_MOST_CHANGE = 0.05


def evidence_and_truth(body: Path) -> dict[str, Any]:
    """Return the evidence of a body's blocks, and what is true of them.

    Parameters
    ----------
    body : Path
        Its folder.

    Returns
    -------
    dict of str to Any
        For the blocks inside the object: "evidence", pairs of numbers; "is_relief", "weight". Empty
        lists where there is no evidence.
    """
    pyramid = _solved(body)
    evidence, coarsest = pyramid.evidence(), pyramid.levels[-1]
    if evidence is None:
        return {"evidence": [], "is_relief": [], "weight": []}
    inside = block_means(coarsest.mask.astype(np.float64), BLOCK) == 1
    values = np.stack([evidence.correlation[inside], evidence.along[inside]], axis=1)
    change = fine_change(coarsest.image / coarsest.mean, coarsest.mask)
    weight = np.minimum(np.sqrt(block_means(change**2, BLOCK)[inside]), _MOST_CHANGE)
    relief = relief_blocks(pyramid, read_truth(body))[inside]
    weight = weight / max(float(weight.sum()), 1e-9)
    return {
        "evidence": np.round(values, 4).tolist(),
        "is_relief": relief.tolist(),
        "weight": np.round(weight, 6).tolist(),
    }


def relief_blocks(pyramid: Pyramid, truth: Truth) -> np.ndarray:
    """Return which blocks of the coarsest level have relief.

    Parameters
    ----------
    pyramid : Pyramid
        Of the photo.
    truth : Truth

    Returns
    -------
    (rows, columns) bool ndarray
    """
    apart = np.where(truth.mask, 1 - (truth.normal * truth.smooth).sum(axis=2), 0)
    framed = np.ascontiguousarray(pyramid.frame.window.cut(apart, 0))
    return np.asarray(block_means(framed, BLOCK << pyramid.frame.halvings) > _LEAST_RELIEF)


def _solved(body: Path) -> Pyramid:
    """The levels of a body that was solved without fine relief."""
    photo, settings = read_photo(body / PHOTO), Settings(detail=0, threads=1)
    options = SolveOptions(fit_lobe=False, check_assumptions=False)
    working = photo.resized_to_object(WORKING_SIZE)
    found = solve(DecompositionTask(working, photo, settings, options=options))
    return Pyramid.of(found.split.diffuse, photo.mask, found.height, found.light)


def rule_weights(features: np.ndarray, is_relief: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Fit the weights of the rule.

    Parameters
    ----------
    features : (n, k) ndarray
    is_relief : (n,) ndarray of bool
    weight : (n,) ndarray
        How much each counts.

    Returns
    -------
    (k + 1,) ndarray
        The offset first.
    """
    inputs = np.column_stack([np.ones(len(features)), features])
    ridge = np.full(inputs.shape[1], _RIDGE)
    ridge[0] = _OFFSET_RIDGE
    return logistic_weights(inputs, is_relief, ridge, weight)


def left_out(
    features: np.ndarray, is_relief: np.ndarray, weight: np.ndarray, body: np.ndarray
) -> np.ndarray:
    """Return each block's probability of relief by weights of the other bodies.

    Parameters
    ----------
    features : (n, k) ndarray
    is_relief : (n,) ndarray of bool
    weight : (n,) ndarray
    body : (n,) ndarray of int
        The body of each block.

    Returns
    -------
    (n,) ndarray
    """
    found = np.zeros(len(features))
    for one in np.unique(body):
        other = body != one
        weights = rule_weights(features[other], is_relief[other], weight[other])
        odds = weights[0] + features[~other] @ weights[1:]
        found[~other] = 1 / (1 + np.exp(-np.clip(odds, -30, 30)))
    return found


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("folder", type=Path, metavar="SET", help="the validation set of benchmarks.detail.sets")
    add("--rows", type=Path, required=True, metavar="FILE", help="JSON lines to append to")
    add("--count", type=int, help="bodies of each kind")
    given = parser.parse_args()
    rows = []
    try:
        for row in body_rows(
            given.folder, given.rows, _KINDS, given.count, "blocks", evidence_and_truth
        ):
            print(row["body"], len(row["weight"]), "blocks", flush=True)
            rows.append(row)
    except InputError as error:
        parser.error(str(error))
    _print_rule([row for row in rows if row["weight"]])


def _print_rule(rows: Sequence[Mapping[str, Any]]) -> None:
    features, is_relief, weight = (
        np.concatenate([np.array(row[name]) for row in rows])
        for name in ("evidence", "is_relief", "weight")
    )
    body = np.repeat(np.arange(len(rows)), [len(row["weight"]) for row in rows])
    kinds = np.array([row["body"].split("_")[0] for row in rows])[body]
    probability = left_out(features, is_relief, weight, body)
    loss = -np.log(np.maximum(np.where(is_relief, probability, 1 - probability), 1e-9))
    correct = (probability > 0.5) == is_relief
    for kind in _KINDS:
        of_kind = kinds == kind
        total = max(float(weight[of_kind].sum()), 1e-9)
        means = [float((one * weight)[of_kind].sum()) / total for one in (loss, correct)]
        print(f"{kind}: log loss {means[0]:.3f}, told correctly {means[1]:.0%}")
    weights = rule_weights(features, is_relief, weight)
    print(ReliefRule(*(round(float(one), 2) for one in weights)))


if __name__ == "__main__":
    main()
