"""The result folder: exactly what the contract names, read back bit by bit, whole or not at all."""

import errno
import json
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from isc_core.errors import Cancelled, InputError
from isc_core.imaging.bounding_box import FramePart
from isc_core.imaging.srgb import srgb_to_linear
from isc_core.io.exr import write_channels
from isc_core.lobe_fitting import GivenLight, fit_lobe
from isc_core.progress import Monitor, ProgressEvent
from isc_core.result_files import result_folder
from isc_core.result_files.contact_sheet import contact_sheet
from isc_core.result_files.result_folder import (
    DECOMPOSITION_FILES,
    SEPARATION_FILES,
    load,
    require_writable_result,
    save,
    save_separation,
)
from isc_core.scene.decomposition import Decomposition, Separation
from isc_core.scene.expected_error import ExpectedError
from isc_core.scene.lobe_fit import LobeFit, LobeFitOutcome
from tests.core.ball_scene import ball

CHANNELS = [
    f"{name}.{c}"
    for name in ("image", "diffuse", "specular", "residual", "reflectance", "shading")
    for c in "RGB"
]
CHANNELS += ["normal.X", "normal.Y", "normal.Z", "height.Z", "mask.A", "confidence.Y"]
KEYS = (
    "schema_version",
    "illumination",
    "camera",
    "brdf",
    "settings",
    "seed",
    "versions",
    "timings",
    "input",
    "status",
    "mesh",
)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("result") / "ball"
    save(ball(), folder)
    return folder


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    save(ball((24, 30), 9.0, (12, 15)), tmp_path / "copy")
    return tmp_path / "copy"


def fitted(d: Decomposition) -> Decomposition:
    """The result with the lobe that its own highlight shows."""
    return replace(d, brdf=fit_lobe(d.specular, d.normal, d.mask))


def channels(path: Path) -> dict[str, np.ndarray]:
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}


def files(folder: Path) -> list[str]:
    return sorted(
        path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()
    )


def test_it_holds_what_the_contract_names(saved: Path) -> None:
    assert files(saved) == sorted(DECOMPOSITION_FILES)
    found = channels(saved / "maps.exr")
    assert sorted(found) == sorted(CHANNELS)
    assert {values.dtype for values in found.values()} == {np.dtype(np.float32)}
    description = json.loads((saved / "decomposition.json").read_text())
    assert set(KEYS) == set(description)
    assert np.shape(description["illumination"]["coefficients"]) == (9, 3)
    assert description["brdf"] is None
    assert description["mesh"]["roughness"] == {"value": 0.5, "source": "not fitted"}


def test_every_channel_is_the_map_it_is_named_after(saved: Path) -> None:
    """Also from strided views, from which the EXR library writes garbage when left alone."""
    d, found = ball(), channels(saved / "maps.exr")
    for name in ("image", "diffuse", "specular", "residual", "reflectance", "shading"):
        for index, letter in enumerate("RGB"):
            assert (found[f"{name}.{letter}"] == getattr(d, name)[..., index]).all(), name
    for index, letter in enumerate("XYZ"):
        assert (found[f"normal.{letter}"] == d.normal[..., index]).all()
    assert (found["height.Z"] == d.height).all()
    assert (found["mask.A"] == d.mask).all()
    assert (found["confidence.Y"] == d.confidence).all()


def test_expected_errors_are_read_back_bit_by_bit(tmp_path: Path) -> None:
    d = ball()
    error = ExpectedError(np.where(d.mask, np.float32(14.5), 0), 0.2 * d.confidence)
    save(replace(d, expected_error=error), tmp_path / "with")
    found = channels(tmp_path / "with" / "maps.exr")
    assert (found["expected_error.normal"] == error.normal).all()
    back = load(tmp_path / "with").expected_error
    assert back is not None
    assert (back.normal == error.normal).all() and (back.reflectance == error.reflectance).all()
    assert back.normal.dtype == back.reflectance.dtype == np.float32


def test_a_result_without_expected_errors_is_read(saved: Path) -> None:
    assert load(saved).expected_error is None


def test_half_of_the_expected_errors_is_damage(tmp_path: Path) -> None:
    d = ball()
    error = ExpectedError(d.confidence, d.confidence)
    save(replace(d, expected_error=error), tmp_path / "with")
    kept = channels(tmp_path / "with" / "maps.exr")
    del kept["expected_error.normal"]
    write_channels(tmp_path / "with" / "maps.exr", kept)
    with pytest.raises(InputError, match=r"lacks the channel expected_error\.normal"):
        load(tmp_path / "with")


def test_the_single_layer_files_can_be_read_by_plain_programs(saved: Path) -> None:
    d = ball()
    for name in ("diffuse", "specular", "reflectance", "shading", "normal"):
        found = channels(saved / "maps" / f"{name}.exr")
        assert sorted(found) == ["B", "G", "R"]
        assert (np.dstack([found[c] for c in "RGB"]) == getattr(d, name)).all()
    height = channels(saved / "maps" / "height.exr")
    assert list(height) == ["Y"]
    assert (height["Y"] == d.height).all()


def test_it_is_read_back_bit_by_bit(saved: Path) -> None:
    d, back = ball(), load(saved)
    for name in (
        "image",
        "diffuse",
        "specular",
        "residual",
        "reflectance",
        "shading",
        "normal",
        "height",
        "mask",
        "confidence",
        "illumination",
    ):
        before, after = getattr(d, name), getattr(back, name)
        assert after.shape == before.shape
        assert after.dtype == before.dtype, name
        assert (after == before).all(), name
    assert back.provenance == d.provenance
    assert back.identity_errors().broken() == ()


@pytest.mark.slow
def test_the_fitted_lobe_is_read_back_number_by_number(tmp_path: Path) -> None:
    d = fitted(ball((48, 60), 20.0, (22, 33)))
    assert d.brdf is not None
    assert d.brdf.determined
    save(d, tmp_path / "out")
    back = load(tmp_path / "out").brdf
    assert back is not None
    assert back.to_json() == d.brdf.to_json()
    assert (back.predicted == d.brdf.predicted).all()
    assert back.predicted.max() > 0.1
    record = json.loads((tmp_path / "out" / "decomposition.json").read_text())["brdf"]
    assert record["model"].startswith("ggx: f_r =")
    assert record["alpha_interval_68"][0] < record["alpha"] < record["alpha_interval_68"][1]


def test_an_undetermined_fit_round_trips_with_its_reason(tmp_path: Path) -> None:
    d = ball((24, 30), 9.0, (12, 15))
    save(replace(d, brdf=fit_lobe(0 * d.specular, d.normal, d.mask)), tmp_path / "out")
    back = load(tmp_path / "out").brdf
    assert back is not None
    assert (back.determined, back.alpha, back.lights) == (False, None, ())
    assert back.outcome == LobeFitOutcome.NO_SPECULAR
    assert not back.predicted.any()


@pytest.mark.slow
def test_a_fit_under_an_environment_is_read_back(tmp_path: Path) -> None:
    d = ball((48, 60), 20.0, (22, 33))
    env_map = np.full((8, 16, 3), 0.02)
    env_map[2, 9] = (40.0, 38.0, 35.0)
    fit = fit_lobe(d.specular, d.normal, d.mask, light=GivenLight(environment=env_map))
    assert fit.strength is not None
    save(replace(d, brdf=fit), tmp_path / "out")
    back = load(tmp_path / "out").brdf
    assert isinstance(back, LobeFit)
    assert back.to_json() == fit.to_json()


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"alpha": "rough"},
        {"alpha": -3.0},
        {"alpha": 1e9},
        {"model": "unknown"},
        {"determined": None},
        {"lights": 3},
        {"lights": [{}]},
        {"explained": None},
        {"alpha_interval_68": [0.1]},
        {"strength": [1]},
    ],
    ids=str,
)
def test_a_damaged_fit_is_one_clear_line(tmp_path: Path, changes: dict[str, object]) -> None:
    folder = tmp_path / "out"
    save(fitted(ball((24, 30), 9.0, (12, 15))), folder)
    record = json.loads((folder / "decomposition.json").read_text())["brdf"]
    damage_json(folder, brdf={**record, **changes})
    with pytest.raises(InputError, match="brdf") as caught:
        load(folder)
    assert "\n" not in str(caught.value)


def test_the_light_of_the_mesh_is_the_recovered_one_over_k(saved: Path) -> None:
    description = json.loads((saved / "decomposition.json").read_text())
    mesh, light = description["mesh"], np.array(description["illumination"]["coefficients"])
    change = (np.array(mesh["illumination"]["coefficients"]) - light) * np.sqrt(1 / (4 * np.pi))
    assert np.allclose(np.exp(change[0]), 1 / mesh["reflectance_scale"])
    assert (change[1:] == 0).all()


def test_equal_results_give_equal_bytes(saved: Path, tmp_path: Path) -> None:
    save(ball(), tmp_path / "again")
    for name in files(saved):
        assert (tmp_path / "again" / name).read_bytes() == (saved / name).read_bytes(), name


def test_strided_maps_are_written_right(tmp_path: Path) -> None:
    d = ball((24, 30), 9.0, (12, 15))
    strided = replace(
        d, height=np.asfortranarray(d.height), image=np.repeat(d.image, 2, axis=1)[:, ::2]
    )
    save(strided, tmp_path / "out")
    assert (load(tmp_path / "out").height == d.height).all()
    assert (load(tmp_path / "out").image == d.image).all()


def test_values_of_numpy_and_infinities_reach_the_json(tmp_path: Path) -> None:
    d = ball((24, 30), 9.0, (12, 15))
    settings = {
        "loss": np.float32(1.5),
        "steps": np.int64(3),
        "bound": float("inf"),
        "sizes": np.array([1, 2]),
        "file": Path("a/b"),
    }
    save(replace(d, provenance=replace(d.provenance, settings=settings)), tmp_path / "out")
    assert load(tmp_path / "out").provenance.settings == {
        "loss": 1.5,
        "steps": 3,
        "bound": None,
        "sizes": [1, 2],
        "file": str(Path("a/b")),
    }


def test_an_earlier_result_is_replaced_and_what_is_foreign_refused(copy: Path) -> None:
    save(ball((20, 20), 8.0, (10, 10)), copy)
    assert load(copy).mask.shape == (20, 20)
    (copy / "scene.blend").write_text("my work")
    for attempt in (
        lambda: save(ball((24, 30), 9.0, (12, 15)), copy),
        lambda: require_writable_result(copy),
    ):
        with pytest.raises(InputError, match=r"scene\.blend"):
            attempt()
    assert (copy / "scene.blend").read_text() == "my work"
    assert load(copy).mask.shape == (20, 20)


def test_maps_with_nan_are_never_written(tmp_path: Path) -> None:
    d = ball((24, 30), 9.0, (12, 15))
    residual = d.residual.copy()
    residual[0, 0, 1] = np.nan
    with pytest.raises(ValueError, match=r"residual\.G"):
        save(replace(d, residual=residual), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("stage", ["writing maps", "building the mesh", "drawing the preview"])
def test_a_cancelled_save_leaves_nothing(tmp_path: Path, stage: str) -> None:
    seen: list[str] = []
    monitor = Monitor(lambda event: seen.append(event.stage), lambda: stage in seen)
    with pytest.raises(Cancelled):
        save(ball((24, 30), 9.0, (12, 15)), tmp_path / "out", monitor=monitor)
    assert seen[-1] == stage
    assert list(tmp_path.iterdir()) == []


def test_a_preview_that_cannot_be_written_is_one_clear_line_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is drawn on a thread of its own."""

    def full(d: Decomposition, part: FramePart) -> Image.Image:
        raise OSError(errno.ENOSPC, "no space")

    monkeypatch.setattr(result_folder, "contact_sheet", full)
    with pytest.raises(InputError, match="no space is left on the disk"):
        save(ball((24, 30), 9.0, (12, 15)), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_a_cancelled_save_waits_for_its_preview(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is removed only when nothing is written into it any more."""
    cancelled, drawn = threading.Event(), threading.Event()

    def slow(d: Decomposition, part: FramePart) -> Image.Image:
        assert cancelled.wait(10)
        drawn.set()
        return contact_sheet(d, part)

    def report(event: ProgressEvent) -> None:
        if event.stage == "building the mesh":
            cancelled.set()

    monkeypatch.setattr(result_folder, "contact_sheet", slow)
    with pytest.raises(Cancelled):
        save(
            ball((24, 30), 9.0, (12, 15)),
            tmp_path / "out",
            monitor=Monitor(report, cancelled.is_set),
        )
    assert drawn.is_set()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of processes")
@pytest.mark.parametrize("limit", [1_000, 150_000])
def test_a_disk_that_takes_no_more_is_one_clear_line_and_leaves_nothing(
    tmp_path: Path, limit: int
) -> None:
    """A real write that fails half-way: a process that may write no file beyond a size."""
    script = (
        "import resource, sys\n"
        "from isc_core.errors import InputError\n"
        "from isc_core.result_files.result_folder import save\n"
        "from tests.core.ball_scene import ball\n"
        "scene = ball()\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))\n"
        "try:\n"
        "    save(scene, sys.argv[1])\n"
        "except InputError as error:\n"
        "    sys.exit(f'error: {error}')\n"
    )
    root = Path(__file__).resolve().parents[3]
    command = [sys.executable, "-c", script, str(tmp_path / "a" / "out")]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: cannot write")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def damage_json(folder: Path, **changes: object) -> None:
    description = json.loads((folder / "decomposition.json").read_text())
    (folder / "decomposition.json").write_text(json.dumps({**description, **changes}))


def drop_channels(folder: Path) -> None:
    kept = {
        name: np.ascontiguousarray(v)
        for name, v in channels(folder / "maps.exr").items()
        if name != "shading.G"
    }
    with OpenEXR.File(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, kept
    ) as file:
        file.write(str(folder / "maps.exr"))


def add_nan(folder: Path) -> None:
    changed = {name: np.array(v) for name, v in channels(folder / "maps.exr").items()}
    changed["height.Z"][3, 3] = np.nan
    with OpenEXR.File(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, changed
    ) as file:
        file.write(str(folder / "maps.exr"))


DAMAGES = {
    "no folder": (lambda f: f.rename(f.with_name("elsewhere")), "not a result folder"),
    "no json": (lambda f: (f / "decomposition.json").unlink(), "not a result folder"),
    "no maps": (lambda f: (f / "maps.exr").unlink(), "does not exist"),
    "text for maps": (lambda f: (f / "maps.exr").write_text("hello"), "not a readable OpenEXR"),
    "empty maps": (lambda f: (f / "maps.exr").write_bytes(b""), "not a readable OpenEXR"),
    "maps cut short": (
        lambda f: (f / "maps.exr").write_bytes((f / "maps.exr").read_bytes()[:2000]),
        "not a readable OpenEXR",
    ),
    "no json text": (lambda f: (f / "decomposition.json").write_text("{"), "damaged"),
    "bytes for json": (
        lambda f: (f / "decomposition.json").write_bytes(b"\xff\xfe\x00"),
        "damaged",
    ),
    "a list": (lambda f: (f / "decomposition.json").write_text("[]"), "schema_version"),
    "no version": (lambda f: damage_json(f, schema_version=None), "schema_version"),
    "from the future": (lambda f: damage_json(f, schema_version=99), "newer"),
    "no light": (lambda f: damage_json(f, illumination=None), "illumination"),
    "half a light": (
        lambda f: damage_json(f, illumination={"coefficients": [[1, 2, 3]]}),
        "illumination",
    ),
    "no light but words": (
        lambda f: damage_json(f, illumination={"coefficients": [["a"] * 3] * 9}),
        "illumination",
    ),
    "seed of words": (lambda f: damage_json(f, seed="x"), "seed"),
    "a channel lost": (drop_channels, r"shading\.G"),
    "not a number": (add_nan, r"height\.Z"),
}


@pytest.mark.parametrize("name", DAMAGES)
def test_a_damaged_folder_is_one_clear_line(copy: Path, name: str) -> None:
    damage, words = DAMAGES[name]
    damage(copy)
    with pytest.raises(InputError, match=words) as caught:
        load(copy)
    assert "\n" not in str(caught.value)


def parts(d: Decomposition) -> Separation:
    return Separation(d.diffuse, d.specular, d.residual, d.confidence)


def test_a_separation_has_its_layers_and_pictures(tmp_path: Path) -> None:
    d = ball()
    save_separation(parts(d), d.image, tmp_path / "out")
    assert files(tmp_path / "out") == sorted(SEPARATION_FILES)
    found = channels(tmp_path / "out" / "separation.exr")
    for name in ("image", "diffuse", "specular", "residual"):
        assert (np.dstack([found[f"{name}.{c}"] for c in "RGB"]) == getattr(d, name)).all()
    assert (found["confidence.Y"] == d.confidence).all()
    for name in ("diffuse", "specular"):
        with Image.open(tmp_path / "out" / f"{name}.png") as picture:
            coded = np.asarray(picture) / 255
        truth = np.clip(getattr(d, name), 0, 1)
        assert (srgb_to_linear(np.clip(coded - 0.501 / 255, 0, 1)) <= truth + 1e-7).all()
        assert (srgb_to_linear(np.clip(coded + 0.501 / 255, 0, 1)) >= truth - 1e-7).all()


def test_a_separation_does_not_replace_a_decomposition(copy: Path) -> None:
    d = ball((24, 30), 9.0, (12, 15))
    with pytest.raises(InputError, match="choose another folder"):
        save_separation(parts(d), d.image, copy)
    load(copy)


def test_a_black_image_cannot_be_shown(tmp_path: Path) -> None:
    d = ball((24, 30), 9.0, (12, 15))
    with pytest.raises(InputError, match="black"):
        save_separation(parts(d), 0 * d.image, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_folder_keeps_the_shared_contract(saved: Path, shared: Path) -> None:
    check = shared / "tools" / "check_result.py"
    done = subprocess.run(
        [sys.executable, str(check), str(saved)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
