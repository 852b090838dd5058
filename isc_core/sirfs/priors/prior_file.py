"""Prior sets as files: NumPy archives without pickles, and the sets that ship with the package:
`data/photo.npz`, fitted to the project's training objects and lights, and `data/priors.npz`, fitted
to MIT-Berkeley.
"""

import dataclasses
import importlib.resources
import json
from functools import cache
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...io.atomic import new_file
from ...io.npy import parse_arrays, write_archive
from ...io.regular_files import read_regular
from .absolute_table import CoarseTable
from .color_mixture import ColorScaleMixture
from .lights import Contrast, GaussianLight
from .prior_set import ILLUMINATIONS, FitRecord, LightPriors, PriorSet
from .priors import Priors, SilhouetteProfile
from .scale_mixture import ScaleMixture

SCHEMA_VERSION = 3
_READABLE = (2, SCHEMA_VERSION)  # files of version 2 have natural and laboratory light
_COEFFICIENTS = 27  # of a light of three channels


def save_prior_set(path: str | Path, priors: PriorSet) -> None:
    """Write a prior set; the same set gives the same bytes.

    Parameters
    ----------
    path : path-like
        Ends in .npz.
    priors : PriorSet

    Raises
    ------
    InputError
        If `path` cannot be written.
    """
    with new_file(path) as partial, partial.open("wb") as file:
        write_archive(file, _to_arrays(priors), compressed=True)


def load_prior_set(path: str | Path) -> PriorSet:
    """Read a set that `save_prior_set` wrote.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    PriorSet

    Raises
    ------
    InputError
        If the file is missing, damaged, of another kind, or of a newer version.
    """
    remedy = "give a file that 'isc fit-priors' wrote"
    try:
        data = read_regular(path, remedy=remedy)
    except OSError as error:
        raise InputError(f"cannot read the priors {path} ({error.strerror}): {remedy}") from error
    return _parse(data, str(path))


@cache
def shipped_priors(illumination: str, channels: int) -> Priors:
    """Return the tables of the shipped set, built once.

    Parameters
    ----------
    illumination : str
    channels : int
        See `PriorSet.priors`.

    Returns
    -------
    Priors

    Raises
    ------
    InputError
        As `shipped_prior_set` and `PriorSet.priors`.
    """
    return shipped_prior_set(illumination).priors(illumination, channels)


def shipped_prior_set(illumination: str = "natural") -> PriorSet:
    """Read the set that ships with the package for a kind of photo.

    Parameters
    ----------
    illumination : str
        "photo", or "natural" or "laboratory", which share one.

    Returns
    -------
    PriorSet

    Raises
    ------
    InputError
        If it is missing or damaged.
    """
    name = "photo.npz" if illumination == "photo" else "priors.npz"
    resource = importlib.resources.files(__package__) / "data" / name
    try:
        data = resource.read_bytes()
    except OSError as error:
        raise InputError(
            "the package's own priors are missing: reinstall it, or give a file with --priors"
        ) from error
    return _parse(data, "the package's own priors")


def _to_arrays(priors: PriorSet) -> dict[str, np.ndarray]:
    record = dataclasses.asdict(priors.record)
    arrays = {
        "schema_version": np.array(SCHEMA_VERSION),
        "record": np.array(json.dumps(record)),
        "color_smoothness.variances": priors.color_smoothness.variances,
        "color_smoothness.weights": priors.color_smoothness.weights,
        "color_smoothness.covariance": priors.color_smoothness.covariance,
        "color_smoothness.reach": np.array(priors.color_smoothness.reach),
        "parsimony_whiten": priors.parsimony_whiten,
        "silhouette.mean": priors.silhouette.mean,
        "silhouette.spread": priors.silhouette.spread,
    }
    for name in ("curvature", "grey_smoothness"):
        mixture: ScaleMixture = getattr(priors, name)
        arrays |= {
            f"{name}.deviations": mixture.deviations,
            f"{name}.weights": mixture.weights,
            f"{name}.reach": np.array(mixture.reach),
        }
    for name in ("absolute", "grey_absolute"):
        table: CoarseTable = getattr(priors, name)
        arrays |= {
            f"{name}.coarse": table.coarse,
            f"{name}.base": np.array(table.base),
            f"{name}.nodes": np.array(table.nodes),
        }
    for name in ILLUMINATIONS:
        light: GaussianLight | None = getattr(priors.lights, name)
        if light is None:
            continue
        arrays |= {f"lights.{name}.mean": light.mean, f"lights.{name}.covariance": light.covariance}
        arrays[f"lights.{name}.floor"] = np.array(light.floor)
    return arrays


def _parse(data: bytes, source: str) -> PriorSet:
    problem = InputError(
        f"{source} is damaged or not a file of priors: give a file that 'isc fit-priors' wrote"
    )
    try:
        arrays = parse_arrays(data, source)
    except InputError as error:
        raise problem from error
    return _Reader(arrays, source).prior_set()


class _Reader:
    """Read a set from the arrays of a file, checking each."""

    def __init__(self, arrays: dict[str, np.ndarray], source: str) -> None:
        self.arrays = arrays
        self.source = source

    def prior_set(self) -> PriorSet:
        version = int(self.numbers("schema_version", ()))
        if version not in _READABLE:
            raise InputError(
                f"{self.source} has format version {version}, not {SCHEMA_VERSION}:"
                " fit the priors again"
            )
        whiten = self.numbers("parsimony_whiten", (3, 3))
        lights = self.lights()
        return PriorSet(
            curvature=self.mixture("curvature"),
            grey_smoothness=self.mixture("grey_smoothness"),
            color_smoothness=self.color_mixture(),
            parsimony_whiten=whiten,
            absolute=self.table("absolute", 3),
            grey_absolute=self.table("grey_absolute", 1),
            silhouette=self.silhouette(),
            lights=lights,
            record=self.record(),
        )

    def error(self, what: str) -> InputError:
        return InputError(f"{self.source}: {what}: fit the priors again with 'isc fit-priors'")

    def array(self, name: str) -> np.ndarray:
        if name not in self.arrays:
            raise self.error(f"'{name}' is missing")
        return self.arrays[name]

    def numbers(
        self, name: str, shape: tuple[int | None, ...], positive: bool = False
    ) -> np.ndarray:
        """A finite array; None in `shape` stands for any length above 0."""
        array = self.array(name)
        if array.dtype.kind not in "fiu" or array.ndim != len(shape) or array.size == 0:
            raise self.error(f"'{name}' has the wrong type or shape")
        if any(
            want is not None and want != got for want, got in zip(shape, array.shape, strict=True)
        ):
            raise self.error(f"'{name}' has shape {array.shape} instead of {shape}")
        if not np.isfinite(array).all() or (positive and not (array > 0).all()):
            raise self.error(f"'{name}' contains invalid values")
        return array

    def covariance(self, name: str, size: int) -> np.ndarray:
        matrix = self.numbers(name, (size, size))
        if not np.array_equal(matrix, matrix.T) or np.linalg.eigvalsh(matrix)[0] <= 0:
            raise self.error(f"'{name}' is not a covariance")
        return matrix

    def weights(self, name: str, count: int) -> np.ndarray:
        weights = self.numbers(name, (count,))
        if weights.min() < 0 or abs(weights.sum() - 1) > 1e-9:
            raise self.error(f"'{name}' are not weights that add up to 1")
        return weights

    def mixture(self, name: str) -> ScaleMixture:
        deviations = self.numbers(f"{name}.deviations", (None,), positive=True)
        reach = float(self.numbers(f"{name}.reach", (), positive=True))
        return ScaleMixture(deviations, self.weights(f"{name}.weights", len(deviations)), reach)

    def color_mixture(self) -> ColorScaleMixture:
        name = "color_smoothness"
        variances = self.numbers(f"{name}.variances", (None,), positive=True)
        weights = self.weights(f"{name}.weights", len(variances))
        covariance = self.covariance(f"{name}.covariance", 3)
        return ColorScaleMixture(
            variances, weights, covariance, float(self.numbers(f"{name}.reach", (), positive=True))
        )

    def table(self, name: str, dimensions: int) -> CoarseTable:
        nodes = int(self.numbers(f"{name}.nodes", (), positive=True))
        coarse = self.numbers(f"{name}.coarse", (-(-nodes // 2),) * dimensions)
        return CoarseTable(coarse, float(self.numbers(f"{name}.base", ())), nodes)

    def silhouette(self) -> SilhouetteProfile:
        mean = self.numbers("silhouette.mean", (None,))
        return SilhouetteProfile(
            mean, self.numbers("silhouette.spread", (len(mean),), positive=True)
        )

    def lights(self) -> LightPriors:
        found = [name for name in ILLUMINATIONS if f"lights.{name}.mean" in self.arrays]
        if not found:
            raise self.error("it has no prior of light")
        return LightPriors(**{name: self.light(f"lights.{name}", _COEFFICIENTS) for name in found})

    def light(self, name: str, size: int) -> GaussianLight:
        mean, covariance = (
            self.numbers(f"{name}.mean", (size,)),
            self.covariance(f"{name}.covariance", size),
        )
        return GaussianLight(
            mean, covariance, float(self.numbers(f"{name}.floor", (), positive=True))
        )

    def record(self) -> FitRecord:
        try:
            record = json.loads(str(self.array("record")))
            return FitRecord(
                tuple(record["objects"]),
                Contrast(**record["natural_contrast"]),
                dict(record["options"]),
            )
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise self.error("its record of the fit is damaged") from error
