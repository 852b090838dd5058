"""Markdown tables of the separation benchmark."""

from collections.abc import Callable, Iterable, Sequence
from itertools import product

import numpy as np

from isc_core.evaluation.metrics import geometric_mean
from isc_core.separation import IMPROVED, METHODS

from .scores import SeparationRow

Cell = Callable[[SeparationRow], str]
_CLAIMED = ("apple", "teabag2", "paper1", "animals", "cups")
_GROUPS = {
    "shen_zheng": "Shen & Zheng's photos (values as stored, whole frame)",
    "laboratory": "Laboratory objects of MIT-Berkeley (linear, inside the mask)",
    "rendered": "Rendered scenes (inside the mask)",
}


def tables(rows: Sequence[SeparationRow]) -> str:
    """Format all tables that the rows allow.

    Parameters
    ----------
    rows : sequence of SeparationRow
        One per method and image.

    Returns
    -------
    str
        Markdown.
    """
    parts = [
        "# Separations against ground truth\n",
        "`none` leaves the photo unchanged: diffuse = input.\n",
    ]
    for group, title in _GROUPS.items():
        found = [row for row in rows if row.group == group]
        if found:
            parts += [f"## {title}\n", *_of_group(found)]
    claim = _claim(rows)
    if claim:
        parts += ["## Sparse Coding against Chaotic Segmentation and the iterative method\n", claim]
    clean = [row for row in rows if row.group == "clean"]
    if clean:
        parts += [
            "## Photos without highlights: RMS of the removed light, per cent of the photo's RMS\n",
            _table(clean, _percent, _worst),
        ]
    refused = sorted({f"- {row.method}, {row.image}: {row.refused}" for row in rows if row.refused})
    if refused:
        parts += ["## Refused\n", "\n".join(refused) + "\n"]
    return "\n".join(parts)


def _claim(rows: Sequence[SeparationRow]) -> str:
    """Gains as the thesis states them (7.6 % diffuse, 53.5 % specular): 1 - mean ratio."""
    found = {
        (row.method, row.variant, row.group, row.image): row
        for row in rows
        if row.mse_ratio is not None
    }
    ours = {key[2:]: row for key, row in found.items() if key[:2] == ("sparse_coding", IMPROVED)}
    lines = [
        "| against | variant | photos | diffuse MSE | specular MSE | diffuse LMSE "
        "| specular LMSE |",
        "|---" * 7 + "|",
    ]
    for other, variant in product(("chaotic_segmentation", "tan_2005"), (IMPROVED, "paper")):
        for title, chosen in (
            (", ".join(_CLAIMED), lambda key: key[1] in _CLAIMED),
            ("rendered", lambda key: key[0] == "rendered"),
        ):
            pairs = [
                (row, found[other, variant, *key])
                for key, row in ours.items()
                if chosen(key) and (other, variant, *key) in found
            ]
            if pairs:
                gains = [
                    _gain(pairs, name)
                    for name in ("mse_ratio", "specular_ratio", "lmse_diffuse", "lmse_specular")
                ]
                lines.append(
                    f"| {other} | {variant} | {len(pairs)} ({title}) | " + " | ".join(gains) + " |"
                )
    return "\n".join(lines) + "\n" if len(lines) > 2 else ""


def _gain(pairs: list[tuple[SeparationRow, SeparationRow]], name: str) -> str:
    values = [(getattr(ours, name), getattr(theirs, name)) for ours, theirs in pairs]
    ratios = [a / b for a, b in values if a is not None and b]
    return f"{100 * (1 - geometric_mean(ratios)):.1f} %" if ratios else "-"


def _of_group(rows: list[SeparationRow]) -> list[str]:
    return [
        "PSNR of the diffuse layer, dB / SSIM (3-D) / SSIM (by channel)\n",
        _table(
            rows,
            lambda r: (
                f"{_number(r.psnr, '.2f')} / {_number(r.ssim_volume, '.3f')}"
                f" / {_number(r.ssim, '.3f')}"
            ),
        ),
        "Mean squared error of the diffuse layer, relative to the unchanged photo: everywhere "
        "(in highlights, elsewhere)\n",
        _table(
            rows,
            lambda r: (
                f"{_number(r.mse_ratio, '.3f')} ({_number(r.mse_inside, '.2f')}, "
                f"{_number(r.mse_outside, '.2f')})"
            ),
            _geometric("mse_ratio"),
        ),
        "Mean squared error of the specular layer, relative to an empty one\n",
        _table(rows, lambda r: _number(r.specular_ratio, ".3f"), _geometric("specular_ratio")),
        "Local error (LMSE) of the diffuse layer x 1000 / of the specular layer\n",
        _table(
            rows,
            lambda r: f"{_scaled(r.lmse_diffuse, 1000, '.2f')} / {_number(r.lmse_specular, '.3f')}",
            _geometric("lmse_specular"),
        ),
        "Confidence: share of the squared error in the least confident fifth, per cent / area "
        "under the sparsification curve / rank correlation with the error\n",
        _table(
            rows,
            lambda r: (
                f"{_scaled(r.removed, 100, '.0f')} / {_number(r.area, '.2f')}"
                f" / {_number(r.rank, '.2f')}"
            ),
        ),
        "Seconds of this run (megapixels per second)\n",
        _table(rows, _speed),
    ]


def _table(
    rows: list[SeparationRow],
    cell: Cell,
    last: tuple[str, Callable[[list[SeparationRow]], str]] | None = None,
) -> str:
    """Methods and variants down, photos across; `last` summarises each line."""
    images = list(dict.fromkeys(row.image for row in rows))
    known = {(row.method, row.variant, row.image): row for row in rows}
    heads = ["method", "variant", *images, *([last[0]] if last else [])]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for method in METHODS:
        for variant in dict.fromkeys(row.variant for row in rows if row.method == method):
            line = [known.get((method, variant, image)) for image in images]
            cells = [
                method,
                variant,
                *("" if row is None else "refused" if row.refused else cell(row) for row in line),
            ]
            lines.append(
                "| "
                + " | ".join(
                    [*cells, *([last[1]([row for row in line if row is not None])] if last else [])]
                )
                + " |"
            )
    return "\n".join(lines) + "\n"


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _scaled(value: float | None, factor: float, form: str) -> str:
    return _number(None if value is None else factor * value, form)


def _percent(row: SeparationRow) -> str:
    return _scaled(row.change, 100, ".2f")


def _speed(row: SeparationRow) -> str:
    if row.seconds is None or row.megapixels is None:
        return "-"
    return f"{row.seconds:.2f} ({row.megapixels / max(row.seconds, 1e-4):.2f})"


def _present(rows: Iterable[SeparationRow], name: str) -> list[float]:
    return [value for row in rows if (value := getattr(row, name)) is not None]


def _geometric(name: str) -> tuple[str, Callable[[list[SeparationRow]], str]]:
    def of(rows: list[SeparationRow]) -> str:
        values = _present(rows, name)
        return f"{geometric_mean(values):.3f}" if values else "-"

    return f"geometric mean ({name})", of


def _worst_change(rows: list[SeparationRow]) -> str:
    values = _present(rows, "change")
    return f"{100 * np.max(values):.2f}" if values else "-"


_worst = ("worst", _worst_change)
