"""The reader of MIT-Berkeley: what it returns is consistent with itself, and what it refuses it
refuses in one line.
"""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy.io

from isc_core.datasets.mit_berkeley import (
    ILLUMINATIONS,
    list_objects,
    load_natural_lights,
    load_object,
)
from isc_core.errors import InputError
from isc_core.evaluation.metrics import truth_normal
from isc_core.shading.spherical_harmonics import reference_basis
from tests.core.training_objects import TRAINING_OBJECTS


@pytest.fixture
def root(shared: Path) -> Path:
    return shared / "data" / "mit_berkeley_train"


@pytest.fixture
def copy(root: Path, tmp_path: Path) -> Path:
    """A set of one object that a test may damage, with the original release's folder names."""
    for source, target in (
        ("laboratory", "MIT-Berkeley-Laboratory"),
        ("natural", "MIT-Berkeley-Natural"),
    ):
        folder = tmp_path / target / "apple"
        folder.mkdir(parents=True)
        for path in (root / source / "apple").iterdir():
            shutil.copyfile(path, folder / path.name)
    return tmp_path


@pytest.mark.parametrize("illumination", ILLUMINATIONS)
def test_lists_the_training_objects(root: Path, illumination: str) -> None:
    assert list_objects(root, illumination) == TRAINING_OBJECTS


@pytest.mark.parametrize("illumination", ILLUMINATIONS)
def test_maps_share_one_crop_and_frame(root: Path, illumination: str) -> None:
    truth = load_object(root, "apple", illumination)
    assert truth.image.shape == truth.shading.shape == truth.reflectance.shape == (222, 267, 3)
    assert truth.valid.shape == truth.mask.shape == truth.height.shape == (222, 267)
    assert truth.valid.sum() == {"natural": 32620, "laboratory": 33475}[illumination]
    assert not (truth.valid & ~truth.mask).any()
    assert truth.light.shape == (9, 3)


def test_natural_image_is_shading_times_reflectance(root: Path) -> None:
    truth = load_object(root, "cup1", "natural")
    assert np.abs(truth.image - truth.shading * truth.reflectance)[truth.valid].max() < 2 / 65535


def test_light_and_height_explain_the_natural_shading(root: Path) -> None:
    truth = load_object(root, "cup1", "natural")
    normal = truth_normal(truth.height)
    known = np.isfinite(normal).all(axis=-1) & truth.valid
    rendered = np.exp(reference_basis(normal[known]) @ truth.light)
    assert np.median(np.abs(rendered - truth.shading[known])) < 1e-4


def test_original_is_diffuse_plus_highlights(root: Path) -> None:
    original, diffuse = (
        load_object(root, "apple", "laboratory", kind) for kind in ("original", "diffuse")
    )
    highlight = (original.image - diffuse.image)[diffuse.valid]
    assert highlight.min() > -2 / 65535 and highlight.max() > 0.1


def test_the_release_layout_reads_the_same(root: Path, copy: Path) -> None:
    for illumination in ILLUMINATIONS:
        assert list_objects(copy, illumination) == ("apple",)
        a, b = (load_object(folder, "apple", illumination) for folder in (root, copy))
        assert np.array_equal(a.image, b.image) and np.array_equal(a.light, b.light)


def test_a_pixel_with_one_black_channel_is_not_valid(copy: Path) -> None:
    path = copy / "MIT-Berkeley-Laboratory" / "apple" / "diffuse.png"
    before = load_object(copy, "apple", "laboratory")
    crop = scipy.io.loadmat(path.parent / "crop_idx.mat")
    stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    # Red is the last channel of the file as this reader gives it.
    stored[int(crop["crop_idx1"][0, 100]) - 1, int(crop["crop_idx2"][0, 120]) - 1, 2] = 0
    assert cv2.imwrite(str(path), stored)
    after = load_object(copy, "apple", "laboratory")
    assert np.argwhere(before.valid != after.valid).tolist() == [[100, 120]]
    assert after.image[100, 120, 0] == 0 < after.image[100, 120, 2]


def test_natural_lights(root: Path) -> None:
    lights = load_natural_lights(root)
    assert lights.shape == (9, 3, 228) and np.isfinite(lights).all()
    assert lights[0].mean() == pytest.approx(-0.56, abs=0.01)


def test_refuses_what_it_does_not_know(root: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="apple, box"):
        load_object(root, "banana", "natural")
    with pytest.raises(InputError, match="unknown object"):
        load_object(root, "../natural/apple", "natural")
    with pytest.raises(InputError, match="natural, laboratory"):
        list_objects(root, "moonlight")
    with pytest.raises(InputError, match="diffuse, original"):
        load_object(root, "apple", "natural", "specular")
    with pytest.raises(InputError, match="no highlights"):
        load_object(root, "apple", "natural", "original")
    with pytest.raises(InputError, match="no folder"):
        list_objects(tmp_path, "natural")
    (tmp_path / "natural").mkdir()
    with pytest.raises(InputError, match="no objects"):
        list_objects(tmp_path, "natural")
    with pytest.raises(InputError, match="natural_lights.mat"):
        load_natural_lights(tmp_path)


@pytest.mark.parametrize(
    "name",
    [
        "Z.mat",
        "L.mat",
        "crop_idx.mat",
        "mask.png",
        "diffuse.png",
        "reflectance.png",
        "shading_corrected_color.mat",
    ],
)
@pytest.mark.parametrize("damage", ["missing", "empty", "truncated", "text"])
def test_a_damaged_file_is_named(copy: Path, name: str, damage: str) -> None:
    path = copy / "MIT-Berkeley-Laboratory" / "apple" / name
    if damage == "missing":
        path.unlink()
    else:
        path.write_bytes(
            {
                "empty": b"",
                "truncated": path.read_bytes()[:150],
                "text": b"no picture, no matrix " * 20,
            }[damage]
        )
    with pytest.raises(InputError, match=name) as caught:
        load_object(copy, "apple", "laboratory")
    assert "\n" not in str(caught.value)


def test_matlab_7_3_is_refused_with_the_remedy(copy: Path) -> None:
    path = copy / "MIT-Berkeley-Laboratory" / "apple" / "Z.mat"
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    path.write_bytes(header + b"\x00" * 384 + b"\x89HDF\r\n\x1a\n" + b"\x00" * 512)
    with pytest.raises(InputError, match="-v7"):
        load_object(copy, "apple", "laboratory")


def test_wrong_contents_are_refused(copy: Path) -> None:
    folder = copy / "MIT-Berkeley-Laboratory" / "apple"
    scipy.io.savemat(folder / "Z.mat", {"depth": np.zeros((50, 50))})
    with pytest.raises(InputError, match="crop"):
        load_object(copy, "apple", "laboratory")
    scipy.io.savemat(folder / "Z.mat", {"height": np.zeros((334, 334))})
    with pytest.raises(InputError, match="has no 'depth'"):
        load_object(copy, "apple", "laboratory")
    scipy.io.savemat(folder / "Z.mat", {"depth": np.zeros((334, 334, 3))})
    with pytest.raises(InputError, match="channel"):
        load_object(copy, "apple", "laboratory")
    shutil.copyfile(folder / "shading.png", folder / "diffuse.png")
    with pytest.raises(InputError, match="16-bit colour"):
        load_object(copy, "apple", "laboratory")


def test_an_empty_mask_is_refused(copy: Path) -> None:
    path = copy / "MIT-Berkeley-Laboratory" / "apple" / "mask.png"
    stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert cv2.imwrite(str(path), np.zeros_like(stored))
    with pytest.raises(InputError, match="mask.png marks no pixel"):
        load_object(copy, "apple", "laboratory")
