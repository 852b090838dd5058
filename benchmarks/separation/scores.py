"""Scores of a separation, and the CSV table of all scores."""

import csv
import hashlib
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields, replace
from functools import cache
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

# Methods that use the file of another method.
_BUILT_ON = {"isc": ("sparse_coding",)}
# Packages of the library that methods use.
_SHARED = ("filters", "imaging", "inpainting", "networks", "numerics", "thresholding")


@dataclass(frozen=True)
class SeparationRow:
    """Scores of one method in one variant on one photo; None: not measured or not defined.

    Attributes
    ----------
    group : str
        "shen_zheng", "laboratory", "rendered", or "clean" for photos without highlights.
    image, method, variant : str
        Names.
    code : str
        Hash of the method's source: the row is measured again when the method changes.
    psnr : float or None
        Of the diffuse layer inside the mask, dB, for values of range 1.
    ssim, ssim_volume : float or None
        By channel, and as MATLAB computes it.
    mse_ratio : float or None
        Mean squared error of the diffuse layer over that of the unchanged photo, inside the mask.
    mse_inside, mse_outside : float or None
        The same inside the highlights and elsewhere.
    specular_ratio : float or None
        Mean squared error of the specular layer over that of an empty one.
    lmse_diffuse, lmse_specular : float or None
        Grosse's local mean squared error.
    removed : float or None
        Share of the squared error in the least confident fifth of the pixels.
    area : float or None
        Area under the sparsification curve.
    rank : float or None
        Rank correlation of confidence and squared error.
    change : float or None
        RMS of the removed light over the RMS of the photo.
    seconds : float or None
        Of this run.
    megapixels : float or None
        Inside the mask.
    refused : str
        Error message, if the method refuses the photo.
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
        """Group, photo, method and variant."""
        return self.group, self.image, self.method, self.variant


def measure(
    group: str, truth: SeparationTruth, method: str, variant: str
) -> tuple[SeparationRow, Separation | None]:
    """Separate a photo and score the result.

    Parameters
    ----------
    group : str
        Group of photos.
    truth : SeparationTruth
        The photo and its layers.
    method, variant : str
        The method.

    Returns
    -------
    row : SeparationRow
        The scores.
    split : Separation or None
        The result; None if the method refuses the photo.
    """
    row = SeparationRow(
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
    """Hash the source that a method depends on.

    Parameters
    ----------
    method : str
        Name of the method.

    Returns
    -------
    str
        Eight digits that change with the method's file or package, with any shared file, and with
        the weights of the networks.
    """
    folder = Path(separation.__file__).parent
    others = set(separation.METHODS) - {method, *_BUILT_ON.get(method, ())}
    files = [
        path
        for path in sorted(folder.rglob("*.py"))
        if others.isdisjoint(path.relative_to(folder).with_suffix("").parts)
    ]
    own = b"".join(path.read_bytes() for path in files)
    return hashlib.sha256(own + _shared_code(folder.parent)).hexdigest()[:8]


@cache
def _shared_code(library: Path) -> bytes:
    """Hash the packages that methods use, and the weights of the networks."""
    found = hashlib.sha256()
    for package in _SHARED:
        for path in sorted((library / package).rglob("*")):
            if path.suffix in (".py", ".npz"):
                found.update(path.read_bytes())
    return found.digest()


def read_rows(path: Path) -> dict[tuple[str, str, str, str], SeparationRow]:
    """Read the table of an earlier run.

    Parameters
    ----------
    path : Path
        The CSV file.

    Returns
    -------
    dict
        Rows by key; empty without a file, or if its columns differ.
    """
    if not path.is_file():
        return {}
    with path.open(newline="", encoding="utf-8") as file:
        table = csv.DictReader(file)
        if table.fieldnames != [field.name for field in fields(SeparationRow)]:
            return {}
        rows = [
            SeparationRow(
                **{
                    field.name: _cell(line[field.name], field.type)
                    for field in fields(SeparationRow)
                }
            )
            for line in table
        ]
    return {row.key: row for row in rows}


def write_rows(path: Path, rows: Iterable[SeparationRow]) -> None:
    """Replace the table atomically.

    Parameters
    ----------
    path : Path
        The CSV file.
    rows : iterable of SeparationRow
        All rows.
    """
    unfinished = path.with_suffix(".part")
    with unfinished.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, [field.name for field in fields(SeparationRow)])
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
