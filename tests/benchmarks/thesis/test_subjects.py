"""The images of `isc thesis`: layers that add up, truths that fit the metrics, public data in
either layout, smaller copies.
"""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks.thesis.images.library import KINDS, SubjectLibrary
from benchmarks.thesis.images.subject import QUICK_SIZE, Subject, downsample_subject
from benchmarks.thesis.measuring.context import Context
from isc_core.datasets.mit_berkeley import MitBerkeleyObject
from isc_core.errors import Cancelled, InputError
from isc_core.evaluation.metrics import Scores, score, truth_normal
from isc_core.masking.finder import MaskSearch
from isc_core.photo.found_mask import FoundMask
from isc_core.progress import Monitor
from isc_core.shading.spherical_harmonics import light_from_reference


def own_score(truth: MitBerkeleyObject) -> Scores:
    """The errors of the truth as an answer."""
    normal = np.nan_to_num(truth_normal(truth.height))
    return score(
        truth,
        height=np.nan_to_num(truth.height),
        normal=normal,
        shading=truth.shading,
        reflectance=truth.reflectance,
        light=light_from_reference(truth.light),
    )


def layers(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """The diffuse and the specular layer, which have to be there."""
    assert subject.diffuse is not None and subject.specular is not None
    return subject.diffuse, subject.specular


def check(subject: Subject) -> None:
    """What holds for every subject with layers."""
    diffuse, specular = layers(subject)
    assert (
        subject.image.dtype == np.float32
        and subject.image.shape == (*subject.mask.shape, 3)
        and (subject.image >= 0).all()
    )
    assert max(subject.mask.shape) <= QUICK_SIZE and subject.mask.any()
    # The laboratory's photos were taken one by one: their layers add up to the photo within its
    # noise.
    assert (
        np.abs(diffuse + specular - subject.image)[subject.mask].mean()
        < 0.02 * subject.image[subject.mask].mean()
    )
    if subject.truth is not None:
        scores = own_score(subject.truth)
        assert (
            max(
                scores.height,
                scores.normal,
                scores.shading,
                scores.reflectance,
                scores.rs_mse,
                scores.light,
            )
            < 1e-6
        )


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Context:
    pytest.importorskip("mitsuba")
    return Context(tmp_path_factory.mktemp("thesis"), quick=True)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_without_data_everything_is_rendered(rendered: Context, kind: str) -> None:
    subjects = rendered.subjects(kind)
    assert len(subjects) == 2
    for subject in subjects:
        check(subject)
        diffuse, specular = layers(subject)
        share = specular[subject.mask].sum() / subject.image[subject.mask].sum()
        assert share == 0 if kind == "diffuse" else 0.03 < share < 0.5, (
            f"{subject.name}: {share:.3f}"
        )
        assert subject.truth is not None
        explained = np.minimum(subject.truth.shading * subject.truth.reflectance, 1)
        assert np.allclose(diffuse[subject.mask], explained[subject.mask], atol=2e-3)


@pytest.mark.slow
def test_what_is_rendered_is_kept_and_the_same(rendered: Context) -> None:
    first = rendered.subjects("synthetic")
    before = {path: path.stat().st_mtime_ns for path in rendered.output.rglob("*.npz")}
    second = Context(rendered.output, quick=True).subjects("synthetic")
    assert before and before == {
        path: path.stat().st_mtime_ns for path in rendered.output.rglob("*.npz")
    }
    assert all(np.array_equal(a.image, b.image) for a, b in zip(first, second, strict=True))


@pytest.mark.slow
def test_stand_ins_for_photos_have_no_ground_truth(rendered: Context) -> None:
    assert all(
        s.truth is None and s.diffuse is None and s.specular is None for s in rendered.photos()
    )


def test_rendering_stops_when_cancelled(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")
    with pytest.raises(Cancelled):
        Context(tmp_path, quick=True, monitor=Monitor(cancelled=lambda: True)).subjects("specular")
    assert not list(tmp_path.rglob("*.npz"))


@pytest.mark.slow
def test_public_data_in_each_layout(shared: Path, tmp_path: Path) -> None:
    data = shared / "data"
    (tmp_path / "MIT-Berkeley-Laboratory").symlink_to(data / "mit_berkeley_train" / "laboratory")
    (tmp_path / "MIT-Berkeley-Natural").symlink_to(data / "mit_berkeley_train" / "natural")
    found = {
        root: Context(tmp_path / "out", root, quick=True)
        for root in (data, data / "mit_berkeley_train", tmp_path)
    }
    for context in found.values():
        context.check()
        names = [subject.name for subject in context.subjects("specular")]
        assert names[:2] == ["apple", "teabag2"]
        assert [subject.name for subject in context.subjects("diffuse")] == ["apple", "teabag2"]
    photos = [
        [subject.name for subject in context.photos()] for context in list(found.values())[:2]
    ]
    assert photos[0] == photos[1] == ["Bag", "Banana"]
    for subject in (*found[data].subjects("specular"), *found[data].subjects("diffuse")):
        check(subject)


def test_photos_with_ground_truth_are_linear_and_whole(shared: Path, tmp_path: Path) -> None:
    library = SubjectLibrary(tmp_path, shared / "data", False, 0)
    subjects = {subject.name: subject for subject in library.subjects("specular", Monitor())}
    assert {"apple", "teabag2", "animals", "cups"} == set(subjects)
    animals = subjects["animals"]
    assert animals.truth is None and animals.mask.all() and animals.diffuse is not None
    assert max(animals.mask.shape) <= 320 and animals.diffuse.mean() < animals.image.mean()


def test_the_fingerprint_follows_the_data(shared: Path, tmp_path: Path) -> None:
    plain, with_data = Context(tmp_path), Context(tmp_path, shared / "data")
    assert (
        plain.fingerprint != with_data.fingerprint == Context(tmp_path, shared / "data").fingerprint
    )
    assert (
        len(
            {
                plain.fingerprint,
                replace(plain, seed=1).fingerprint,
                replace(plain, quick=True).fingerprint,
            }
        )
        == 3
    )


def photo_folder(folder: Path, files: dict[str, int]) -> Path:
    """A data folder with photos of a brighter and a darker half."""
    (folder / "photos").mkdir(parents=True)
    for name, level in files.items():
        picture = np.zeros((24, 24, 3), np.uint8)  # a black border, outside of the object
        picture[6:-6, 6:-6] = level
        picture[6:-6, 12:-6] = level - 50
        assert cv2.imwrite(str(folder / "photos" / name), picture)
    return folder


def test_results_of_other_photos_are_not_taken_for_those_of_these(tmp_path: Path) -> None:
    one, other = (
        Context(tmp_path / "out", photo_folder(tmp_path / name, {"cup.png": level}))
        for name, level in (("a", 100), ("b", 200))
    )
    assert one.fingerprint != other.fingerprint, "the photos differ, only their names agree"
    assert one.rows("key", lambda: [{"of": "one"}]) != other.rows("key", lambda: [{"of": "other"}])
    shutil.copytree(tmp_path / "a", tmp_path / "moved")
    assert Context(tmp_path / "out", tmp_path / "moved").fingerprint == one.fingerprint
    photo_folder(tmp_path / "c", {"cup.png": 100, "hat.png": 100})
    assert Context(tmp_path / "out", tmp_path / "c").fingerprint != one.fingerprint


def test_photos_of_one_stem_have_different_names(tmp_path: Path) -> None:
    """Their decompositions are kept by name."""
    data = photo_folder(tmp_path, {"cup.png": 100, "cup.bmp": 200, "hat.png": 150})
    photos = SubjectLibrary(tmp_path / "cache", data, False, 0).photos(Monitor())
    assert [photo.name for photo in photos] == ["photos-cup.bmp", "photos-cup.png", "hat"]


def test_the_mask_of_a_photo_is_found_as_by_isc_decompose(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "photos").mkdir()
    picture = np.full((40, 40, 3), 200, np.uint8)
    picture[10:30, 10:30] = np.arange(20, 220, 10, np.uint8)[:, None, None] // 2
    cv2.imwrite(str(tmp_path / "photos" / "box.png"), picture)
    mask = np.zeros((40, 40), bool)
    mask[10:30, 10:30] = True

    def found(search: MaskSearch, name: str, light: np.ndarray) -> FoundMask:
        del search, name, light
        return FoundMask(mask.astype(np.float32), 0.9, np.array([0.0, 1.0, 0.0]), np.zeros(0))

    monkeypatch.setattr(MaskSearch, "__call__", found)
    (photo,) = SubjectLibrary(tmp_path / "cache", tmp_path, False, 0).photos(Monitor())
    assert photo.mask.sum() == 400 and photo.mask.shape == (28, 28)


def test_a_folder_without_known_data_is_refused(tmp_path: Path) -> None:
    os.makedirs(tmp_path / "holidays")
    with pytest.raises(InputError, match="holds no known data set"):
        Context(tmp_path / "out", tmp_path).check()


def plane(size: int) -> Subject:
    """A tilted plane whose height rises by a third of a pixel each column, half of it outside the
    mask.
    """
    mask = np.zeros((size, size), bool)
    mask[size // 4 : -size // 4, size // 4 : -size // 4] = True
    columns = np.broadcast_to(np.arange(size) / 3, (size, size))
    height = np.where(mask, columns, np.nan)
    image = np.where(mask[..., None], 0.2 + 0.001 * columns[..., None] * np.ones(3), 0).astype(
        np.float32
    )
    truth = MitBerkeleyObject(
        "plane",
        "laboratory",
        image.astype(float),
        mask,
        mask,
        height,
        image + 0.1,
        image + 0.2,
        np.zeros((9, 3)),
    )
    return Subject("plane", "specular", image, mask, 0.75 * image, 0.25 * image, truth)


def test_a_smaller_copy_keeps_light_and_slope() -> None:
    subject = plane(240)
    small = downsample_subject(subject, QUICK_SIZE)
    assert small.mask.shape == (80, 80) and small.truth is not None and subject.truth is not None
    assert small.image[small.mask].mean() == pytest.approx(
        subject.image[subject.mask].mean(), rel=1e-4
    )
    assert np.allclose(
        np.diff(small.truth.height, axis=1)[small.truth.mask[:, 1:] & small.truth.mask[:, :-1]],
        1 / 3,
    )
    assert (
        np.array_equal(np.isfinite(small.truth.height), small.mask)
        and small.truth.valid.sum() == small.mask.sum()
    )
    assert np.allclose(sum(layers(small)), small.image, atol=1e-6)
    # No light of the background gets into the object.
    assert small.image[small.mask].min() >= subject.image[subject.mask].min()
    assert downsample_subject(subject, 240) is subject
