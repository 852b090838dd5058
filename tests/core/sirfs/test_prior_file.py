"""Files of priors: nothing is lost in them, and what is not one is refused in one clear line."""

import dataclasses
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isc_core.errors import InputError
from isc_core.sirfs.priors.absolute_table import CoarseTable
from isc_core.sirfs.priors.color_mixture import ColorScaleMixture
from isc_core.sirfs.priors.lights import Contrast, GaussianLight
from isc_core.sirfs.priors.prior_file import load_prior_set, save_prior_set, shipped_prior_set
from isc_core.sirfs.priors.prior_set import FitRecord, LightPriors, PriorSet
from isc_core.sirfs.priors.priors import SilhouetteProfile
from isc_core.sirfs.priors.scale_mixture import ScaleMixture


@pytest.fixture
def prior_set() -> PriorSet:
    rng = np.random.default_rng(0)

    def covariance(size: int) -> np.ndarray:
        a = rng.normal(size=(size, 2 * size))
        return a @ a.T

    def light(size: int) -> GaussianLight:
        return GaussianLight(rng.normal(size=size), covariance(size))

    mixture = ScaleMixture(np.geomspace(0.001, 1, 5), rng.dirichlet(np.ones(5)), 0.7)
    color = ColorScaleMixture(
        np.geomspace(0.001, 1, 5), rng.dirichlet(np.ones(5)), covariance(3), 2.5
    )
    return PriorSet(
        curvature=mixture,
        grey_smoothness=dataclasses.replace(mixture, reach=1.3),
        color_smoothness=color,
        parsimony_whiten=covariance(3),
        absolute=CoarseTable.of(rng.normal(size=(5, 5, 5)), 10),
        grey_absolute=CoarseTable.of(rng.normal(size=8), 16, np.float32),
        silhouette=SilhouetteProfile(np.linspace(0.6, 0, 7), np.full(7, 0.4)),
        lights=LightPriors(light(27), light(27)),
        record=FitRecord(("apple", "cup1"), Contrast(2.5, 1 / 3), {"iterations": "200"}),
    )


def assert_same(one: Any, other: Any) -> None:
    """Equal bit by bit, through all nested objects."""
    assert type(one) is type(other)
    if dataclasses.is_dataclass(one):
        for entry in dataclasses.fields(one):
            assert_same(getattr(one, entry.name), getattr(other, entry.name))
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        assert one.tobytes() == other.tobytes()
        assert one.shape == other.shape
    else:
        assert one == other


def rewrite(path: Path, changes: dict[str, Any]) -> None:
    """The archive at `path` with some arrays replaced (None: removed)."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    arrays |= changes
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})


def test_round_trip_is_exact(prior_set: PriorSet, tmp_path: Path) -> None:
    path = tmp_path / "priors.npz"
    save_prior_set(path, prior_set)
    assert_same(load_prior_set(path), prior_set)


def test_a_set_of_photos_alone_round_trips_and_says_what_it_lacks(
    prior_set: PriorSet, tmp_path: Path
) -> None:
    alone = dataclasses.replace(prior_set, lights=LightPriors(photo=prior_set.lights.natural))
    path = tmp_path / "priors.npz"
    save_prior_set(path, alone)
    found = load_prior_set(path)
    assert_same(found, alone)
    assert found.priors("photo").light.mean.shape == (27,)
    with pytest.raises(InputError, match="no light for --illumination natural"):
        found.priors("natural")


def test_photos_take_natural_light_where_a_set_has_nothing_better(prior_set: PriorSet) -> None:
    photo, natural = prior_set.priors("photo"), prior_set.priors("natural")
    np.testing.assert_array_equal(photo.light.covariance, natural.light.covariance)


def test_files_of_version_2_are_read(prior_set: PriorSet, tmp_path: Path) -> None:
    path = tmp_path / "priors.npz"
    save_prior_set(path, prior_set)
    rewrite(path, {"schema_version": np.array(2)})
    assert_same(load_prior_set(path), prior_set)


def test_a_set_without_any_light_is_refused(prior_set: PriorSet, tmp_path: Path) -> None:
    path = tmp_path / "priors.npz"
    save_prior_set(path, dataclasses.replace(prior_set, lights=LightPriors()))
    with pytest.raises(InputError, match="no prior of light"):
        load_prior_set(path)


def test_same_priors_give_the_same_bytes(prior_set: PriorSet, tmp_path: Path) -> None:
    save_prior_set(tmp_path / "a.npz", prior_set)
    save_prior_set(tmp_path / "b.npz", prior_set)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_plain_numpy_can_read_the_file(prior_set: PriorSet, tmp_path: Path) -> None:
    path = tmp_path / "priors.npz"
    save_prior_set(path, prior_set)
    with np.load(path, allow_pickle=False) as file:
        assert np.array_equal(file["parsimony_whiten"], prior_set.parsimony_whiten)


def test_unwritable_place(prior_set: PriorSet, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot write"):
        save_prior_set(tmp_path / "file" / "priors.npz", prior_set)


def test_failed_write_leaves_nothing(prior_set: PriorSet, tmp_path: Path) -> None:
    broken = dataclasses.replace(prior_set, parsimony_whiten=np.array([object()]))
    with pytest.raises(ValueError):
        save_prior_set(tmp_path / "priors.npz", broken)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [b"", b"not an archive", b"PK\x03\x04 cut short"])
def test_foreign_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "priors.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match="fit-priors") as caught:
        load_prior_set(path)
    assert "\n" not in str(caught.value)


def test_truncated_file(prior_set: PriorSet, tmp_path: Path) -> None:
    path = tmp_path / "priors.npz"
    save_prior_set(path, prior_set)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(InputError, match="damaged"):
        load_prior_set(path)


def test_one_plain_array_is_not_a_set(tmp_path: Path) -> None:
    path = tmp_path / "priors.npy"
    np.save(path, np.zeros(3))
    with pytest.raises(InputError, match="not a file of priors"):
        load_prior_set(path)


def test_pickles_are_refused(prior_set: PriorSet, tmp_path: Path) -> None:
    path = tmp_path / "priors.npz"
    save_prior_set(path, prior_set)
    with zipfile.ZipFile(path) as archive:
        assert "parsimony_whiten.npy" in archive.namelist()
    rewrite(path, {"parsimony_whiten": np.array([{}], dtype=object)})
    with pytest.raises(InputError):
        load_prior_set(path)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read"):
        load_prior_set(tmp_path / "absent.npz")
    with pytest.raises(InputError, match="is a folder"):
        load_prior_set(tmp_path)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("schema_version", np.array(999), "version 999"),
        ("schema_version", None, "missing"),
        ("curvature.weights", None, "'curvature.weights' is missing"),
        ("curvature.weights", np.full(5, 0.3), "add up"),
        ("curvature.deviations", np.array([1.0, 2, 3, 4, -1]), "invalid values"),
        ("parsimony_whiten", np.full((3, 3), np.nan), "invalid values"),
        ("parsimony_whiten", np.eye(2), "shape"),
        ("absolute.coarse", np.zeros((5, 5), np.float16), "wrong type or shape"),
        ("absolute.nodes", np.array(12), "shape"),
        ("lights.natural.covariance", -np.eye(27), "not a covariance"),
        ("lights.natural.mean", np.zeros(9), "shape"),
        ("record", np.array("{"), "record"),
        ("record", np.array("{}"), "record"),
    ],
)
def test_wrong_contents(
    prior_set: PriorSet, tmp_path: Path, name: str, value: Any, message: str
) -> None:
    path = tmp_path / "priors.npz"
    save_prior_set(path, prior_set)
    rewrite(path, {name: value})
    with pytest.raises(InputError, match=message) as caught:
        load_prior_set(path)
    assert "\n" not in str(caught.value)


def test_unknown_kinds_of_photo(prior_set: PriorSet) -> None:
    with pytest.raises(InputError, match="natural, laboratory"):
        prior_set.priors("candle")
    with pytest.raises(InputError, match="channels"):
        prior_set.priors("natural", 4)


class TestShipped:
    def test_the_priors_of_photos_have_learned_from_made_bodies_alone(self) -> None:
        shipped = shipped_prior_set("photo")
        assert all(name.startswith(("built/", "family/")) for name in shipped.record.objects)
        assert shipped.lights.natural is None and shipped.lights.laboratory is None
        assert shipped.lights.photo is not None

    @pytest.mark.slow
    def test_expands_for_every_kind_of_photo(self) -> None:
        shipped = shipped_prior_set()
        for illumination in ("natural", "laboratory"):
            assert shipped.priors(illumination, 3).absolute.values.shape == (102, 102, 102)
            assert shipped.priors(illumination, 1).absolute.values.shape == (256,)

    def test_half_precision_stays_below_a_hundredth_of_the_range(self) -> None:
        table = shipped_prior_set().absolute
        step = np.spacing(table.coarse.max())
        assert step / 2 < 0.01 * np.ptp(table.table().values)

    def test_smoothness_costs_grow_with_the_difference(self) -> None:
        priors = shipped_prior_set().priors("natural", 3)
        assert (np.diff(priors.smoothness.values) > 0).all()
        middle = len(priors.curvature.values) // 2
        assert (np.diff(priors.curvature.values[middle:]) >= 0).all()
