"""What the benchmark of separations measures on one photo, and the table of rows that it keeps on
disk.
"""

import csv
import hashlib
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from isc_core import separation
from isc_core.datasets.highlight_set import SeparationTruth
from isc_core.errors import InputError
from isc_core.evaluation.image_metrics import (
    highlight_region,
    rank_correlation,
    sparsification,
    ssim,
    ssim_volume,
)
from isc_core.evaluation.metrics import lmse, mse, psnr
from isc_core.scene.decomposition import Separation

# Methods that read another method's file too.
_BUILT_ON = {"isc": ("sparse_coding",)}


@dataclass(frozen=True)
class Row:
    """One method in one variant on one photo; None: not measured, or not defined.

    `group`: "shen_zheng", "laboratory", "rendered", or "clean" for photos without any highlight.
    `code`: of the method's source, so that a row is measured anew once the method changes. `psnr`:
    dB, inside the mask, of values of range 1; `ssim` by channel, `ssim_volume` as MATLAB.
    `mse_ratio`: the diffuse layer's mean square error over that of the untouched photo, inside the
    mask; `mse_inside`, `mse_outside` the highlights; `specular_ratio`: the specular layer's over
    that of none. `lmse_*`: Grosse's local error. `removed`: share of the squared error that leaves
    with the least confident fifth; `area` under the sparsification curve; `rank`: correlation of
    confidence and squared error. `change`: RMS of what was removed over the photo's RMS. `seconds`:
    of this run; `megapixels` inside the mask; `refused`: why there is no answer.
    """

    group: str
    image: str
    method: str
    variant: str
    code: str = ""
    psnr: float | None = None
    ssim: float | None = None
    ssim_volume: float | None = None
    mse_ratio: float | None = None
    mse_inside: float | None = None
    mse_outside: float | None = None
    specular_ratio: float | None = None
    lmse_diffuse: float | None = None
    lmse_specular: float | None = None
    removed: float | None = None
    area: float | None = None
    rank: float | None = None
    change: float | None = None
    seconds: float | None = None
    megapixels: float | None = None
    refused: str = ""

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Photo, method and variant."""
        return self.group, self.image, self.method, self.variant


def measure(
    group: str, truth: SeparationTruth, method: str, variant: str
) -> tuple[Row, Separation | None]:
    """Separates and scores; None where the method refuses the photo."""
    row = Row(
        group,
        truth.name,
        method,
        variant,
        source_code(method),
        megapixels=float(truth.mask.sum()) / 1e6,
    )
    start = time.perf_counter()
    try:
        split = separation.separate(method, truth.image, truth.mask, truth.clipped, variant=variant)
    except InputError as error:
        return replace(row, refused=str(error)), None
    seconds = round(time.perf_counter() - start, 4)
    row = replace(row, change=_change(truth, split), seconds=seconds)
    return row if group == "clean" else replace(row, **_against_truth(truth, split)), split


def source_code(method: str) -> str:
    """Eight digits that change with the method's source file, and with any that is not a method's
    own.
    """
    folder = Path(separation.__file__).parent
    others = set(separation.METHODS) - {method, *_BUILT_ON.get(method, ())}
    files = [path for path in sorted(folder.glob("*.py")) if path.stem not in others]
    files += sorted((folder.parent / "inpainting").glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:8]


def read_rows(path: Path) -> dict[tuple[str, str, str, str], Row]:
    """The rows that an earlier run wrote; none where there is no such file or its columns have
    changed.
    """
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        table = csv.DictReader(file)
        if table.fieldnames != [field.name for field in fields(Row)]:
            return {}
        rows = [
            Row(**{field.name: _cell(line[field.name], field.type) for field in fields(Row)})
            for line in table
        ]
    return {row.key: row for row in rows}


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """Writes the whole table, or leaves the old one."""
    unfinished = path.with_suffix(".part")
    with unfinished.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, [field.name for field in fields(Row)])
        table.writeheader()
        table.writerows({name: _text(value) for name, value in asdict(row).items()} for row in rows)
    unfinished.replace(path)


def _cell(text: str, kind: object) -> Any:
    return text if kind is str else None if text == "" else float(text)


def _text(value: object) -> object:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else value


def _against_truth(truth: SeparationTruth, split: Separation) -> dict[str, Any]:
    mask, inside = truth.mask, truth.mask[..., None]
    image, diffuse, specular = (
        np.where(inside, layer, 0).astype(np.float64)
        for layer in (truth.image, truth.diffuse, truth.specular)
    )
    answer = np.where(inside, split.diffuse, 0).astype(np.float64)
    highlights = highlight_region(specular, mask)
    error = ((answer - diffuse)[mask] ** 2).mean(axis=1)
    curve = sparsification(error, split.confidence[mask])
    found = np.where(inside, split.specular, 0).astype(np.float64)
    return {
        "psnr": psnr(diffuse, answer, mask),
        "ssim": ssim(diffuse, answer, mask),
        "ssim_volume": ssim_volume(diffuse, answer, mask),
        "mse_ratio": _ratio(diffuse, answer, image, mask),
        "mse_inside": _ratio(diffuse, answer, image, highlights),
        "mse_outside": _ratio(diffuse, answer, image, mask & ~highlights),
        "specular_ratio": _ratio(specular, found, np.zeros_like(found), mask),
        "lmse_diffuse": lmse(diffuse, answer, mask),
        "lmse_specular": lmse(specular, found, mask)
        if (specular[mask] > 0).any(axis=0).all()
        else None,
        "removed": curve.removed(0.2),
        "area": curve.area,
        "rank": rank_correlation(split.confidence[mask], error),
    }


def _ratio(
    diffuse: np.ndarray, answer: np.ndarray, image: np.ndarray, region: np.ndarray
) -> float | None:
    if not region.any() or (nothing := mse(diffuse, image, region)) == 0:
        return None
    return mse(diffuse, answer, region) / nothing


def _change(truth: SeparationTruth, split: Separation) -> float:
    photo = truth.image[truth.mask].astype(np.float64)
    return float(np.sqrt(np.mean((split.diffuse[truth.mask] - photo) ** 2) / np.mean(photo**2)))
