"""`isc edit`: each action ends with pictures, a mistake with one line and nothing written."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from isc_core.cli.main import main
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.io.exr import read_channels, write_channels
from isc_core.result_files import maps_file
from isc_core.result_files.result_folder import load_part, save
from tests.core.ball_scene import LIGHT, ball

FILES = {"edit.json", "edited.png", "edited.exr", "before_after.png"}


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result folder, `ball`, and the photo that it is of."""
    folder = tmp_path_factory.mktemp("edit")
    scene = ball()
    scene.provenance.input.update(
        size=[120, 96], scale=1.0, bit_depth=16, transfer="srgb", mask_from="alpha"
    )
    save(scene, folder / "ball")
    codes = np.rint(65535 * np.clip(linear_to_srgb(scene.image), 0, 1)).astype(np.uint16)
    cv2.imwrite(
        str(folder / "photo.png"),
        np.dstack([codes[..., ::-1], 65535 * scene.mask.astype(np.uint16)]),
    )
    (folder / "light.json").write_text(json.dumps(LIGHT[::-1].tolist()))
    np.save(folder / "light.npy", LIGHT)
    cv2.imwrite(
        str(folder / "sky.png"), np.random.default_rng(0).integers(0, 255, (16, 32, 3), np.uint8)
    )
    env_map = np.full((16, 32, 3), 0.5, np.float32)
    write_channels(
        folder / "broken.exr",
        {name: np.where(np.arange(32) == 3, np.inf, env_map[..., 0]) for name in "RGB"},
    )
    cv2.imwrite(
        str(folder / "region.png"),
        np.uint8(255 * (np.arange(120) < 60)) * np.ones((96, 1), np.uint8),
    )
    return folder


ACTIONS = [
    "light-direction",
    "highlight --direction -0.5 0.6 -0.1 --colour ff8000 --exponent 30",
    "highlight --like specular --alpha 0.2 --strength 0.5 --replace",
    "gloss --look glossier",
    "gloss --look metallic --exponent 20 --gain 0.8",
    "gloss --exponent 10 --present 60 --method render",
    "dichromatic --remove specular --diffuse-gamma 1.4",
    "dichromatic --specular-gain 2 --specular-sharpen 1.5 --specular-radius 4",
    "recolour --hue -40 --saturation 1.5 --region {}/region.png",
    "recolour --colour #2060c0 --match-brightness --cluster 2 --clusters 2",
    "relight --yaw 60 --pitch -20",
    "relight --light {}/light.json --roll 10",
    "relight --light {}/light.npy",
    "relight --light {}/sky.png --exponent 40",
    "relight --direction -1 0 1 --ambient 0.3 --colour ffe0c0 --highlights remove",
]


@pytest.mark.slow
@pytest.mark.parametrize("action", ACTIONS)
def test_every_action_writes_its_pictures(
    work: Path, tmp_path: Path, action: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = action.format(work).split()
    assert main(["edit", str(work / "ball"), *words, "-o", str(tmp_path / "out"), "--quiet"]) == 0
    found = {path.name for path in (tmp_path / "out").iterdir()}
    assert found - {"clusters.png"} == FILES
    assert ("clusters.png" in found) == (words[0] == "recolour")
    told = json.loads((tmp_path / "out" / "edit.json").read_text())
    assert told["action"] == words[0] and told["schema_version"] == 1
    output = capsys.readouterr()
    assert not output.err
    assert (
        ("shading: from" in output.out)
        == (words[0] == "light-direction")
        == ("predicted: " in output.out)
    )


@pytest.fixture(scope="module")
def corner(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small ball in a frame, of which files store `part`, or `whole` the frame; and its photo."""
    folder = tmp_path_factory.mktemp("corner")
    scene = ball((96, 120), 20.0, (60.0, 85.0))
    scene.provenance.input.update(bit_depth=8, transfer="srgb", mask_from="alpha")
    save(scene, folder / "whole")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maps_file, "_LEAST_PIXELS", 100)
        save(scene, folder / "part")
    picture = np.where(scene.mask[..., None], scene.image, 0.3)
    codes = np.rint(255 * np.clip(linear_to_srgb(picture), 0, 1)).astype(np.uint8)
    cover = np.where(scene.mask, 255, np.arange(120, dtype=np.uint8))
    cv2.imwrite(str(folder / "photo.png"), np.dstack([codes[..., ::-1], cover]))
    region = np.random.default_rng(1).integers(0, 255, (96, 120), np.uint8)
    cv2.imwrite(str(folder / "region.png"), region)
    return folder


@pytest.mark.parametrize(
    "action",
    [
        "dichromatic --diffuse-sharpen 2 --specular-gain 0.5",
        "recolour --hue 80 --region {}/region.png --photo {}/photo.png",
        *(
            pytest.param(words, marks=pytest.mark.slow)
            for words in (
                "light-direction",
                "highlight --like specular",
                "gloss --look metallic --photo {}/photo.png",
                "recolour --cluster 1 --colour 2060c0",
                "recolour --hue 80 --region {}/region.png",
                "relight --yaw 40 --photo {}/photo.png",
            )
        ),
    ],
)
def test_files_of_an_edit_are_those_of_the_whole_frame(
    corner: Path, tmp_path: Path, action: str
) -> None:
    """Results of large frames store, and edits read, the object's part."""
    words = action.format(corner, corner).split()
    for name in ("part", "whole"):
        assert load_part(corner / name).part.is_whole == (name == "whole")
        output = str(tmp_path / name)
        assert main(["edit", str(corner / name), *words, "-o", output, "--quiet"]) == 0
    files = {path.name for path in (tmp_path / "whole").iterdir()}
    assert files >= FILES and files == {path.name for path in (tmp_path / "part").iterdir()}
    for name in files:
        part, whole = ((tmp_path / of / name).read_bytes() for of in ("part", "whole"))
        named = (str(corner / of).encode() for of in ("part", "whole"))
        assert part.replace(*named) == whole, name


def before_and_after(work: Path, folder: Path, words: str) -> tuple[np.ndarray, np.ndarray]:
    """The photo before and after an edit that is composited into it."""
    photo = work / "photo.png"
    common = ["--photo", str(photo), "-o", str(folder), "--quiet"]
    assert main(["edit", str(work / "ball"), *words.split(), *common]) == 0
    before, after = (
        cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for path in (photo, folder / "edited.png")
    )
    return before, after


def test_an_edit_of_the_photo_changes_the_object_only(work: Path, tmp_path: Path) -> None:
    before, after = before_and_after(work, tmp_path / "out", "recolour --hue 90")
    mask = ball().mask
    assert (
        after.dtype == np.uint16
        and np.array_equal(after[~mask], before[~mask])
        and np.array_equal(after[..., 3], before[..., 3])
    )
    assert not np.array_equal(after[mask], before[mask])


@pytest.mark.slow
def test_an_edit_without_effect_returns_the_photo(work: Path, tmp_path: Path) -> None:
    for words in (
        "dichromatic",
        "recolour --hue 360",
        "relight --yaw 360",
        f"relight --light {work}/light.npy",
        "gloss",
    ):
        before, after = before_and_after(work, tmp_path / "out", words)
        assert np.array_equal(before, after), words


MISTAKES = {
    "": "ACTION",
    "paint": "invalid choice",
    "gloss --metal 2": "metal",
    "gloss --look glossier --exponent 9": "give one of them",
    "gloss --exponent -5": "exponent",
    "highlight --direction 0 0 0": "no direction",
    "highlight --exponent 9 --alpha 0.2": "give one of them",
    "highlight --colour banana": "RRGGBB",
    "highlight --strength -1": "strength",
    "dichromatic --diffuse-gain -1": "gain",
    "dichromatic --specular-gamma nan": "not a number",
    "dichromatic --specular-gain 1e39": "gain",
    "dichromatic --remove specular --specular-gain 2": "give one of them",
    "gloss --gain 1e308": "gain",
    "gloss --present 30": "--exponent",
    "highlight --strength 1e308": "strength",
    "highlight --like specular --direction 0 0 1": "give one of them",
    "relight --highlights keep --exponent 30 --yaw 5": "give one of them",
    "relight --light {}/broken.exr": "infinite",
    "recolour --colour ١٢٣٤٥٦": "RRGGBB",
    "recolour --cluster 9": "no cluster 9",
    "recolour --clusters 99": "clusters are not possible",
    "recolour --cluster 1 --region {}/region.png": "give one of them",
    "recolour --region {}/sky.png": "photo's size",
    "recolour --match-brightness": "brightness",
    "relight --light {}/nothing.json": "cannot read",
    "relight --light {}/region.png": "twice as wide as high",
    "relight --light {}/light.npy --direction 0 0 1": "give one of them",
    "relight --light {}/sky.png --yaw 3": "cannot be rotated",
    "relight --ambient 3": "--direction",
    "relight --direction 0 0 -1 --ambient 0": "no visible part of the object",
    "relight --exposure 0": "exposure",
    "relight --yaw 9 --mask {}/region.png": "--photo",
    "relight --yaw 9 --photo {}/region.png": "",
    "relight --yaw 9 --photo {}/nothing.png": "no such file",
}


@pytest.mark.parametrize(("words", "told"), MISTAKES.items())
def test_a_mistake_is_one_line_and_writes_nothing(
    work: Path, tmp_path: Path, words: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out"
    assert (
        main(
            ["edit", str(work / "ball"), *words.format(work).split(), "-o", str(output), "--quiet"]
        )
        == 2
    )
    error = capsys.readouterr().err
    assert error.startswith("isc: error: ") and error.count("\n") == 1 and told in error
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_ours_is_left_alone(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    for folder in (work / "ball", tmp_path):
        assert main(["edit", str(work / "ball"), "gloss", "-o", str(folder), "--quiet"]) == 2
    assert main(["edit", str(tmp_path), "gloss", "-o", str(tmp_path / "out"), "--quiet"]) == 2
    assert (
        tmp_path / "mine.txt"
    ).read_text() == "mine" and "decomposition.json" in capsys.readouterr().err


def edited(result: Path, output: Path, *words: str) -> np.ndarray:
    """The picture's codes (H, W, 3) after an edit that works."""
    assert main(["edit", str(result), *words, "-o", str(output), "--quiet"]) == 0
    return cv2.imread(str(output / "edited.png"), cv2.IMREAD_UNCHANGED)[..., :3].astype(int)


@pytest.mark.parametrize("coding", ["alpha", "0 and 1"])
def test_a_region_is_read_as_a_mask_is(work: Path, tmp_path: Path, coding: str) -> None:
    left = (np.arange(120) < 60) * np.ones((96, 1), np.uint8)
    region = (
        np.dstack([np.full((96, 120, 3), 255, np.uint8), np.uint8(255) * left])
        if coding == "alpha"
        else left
    )
    cv2.imwrite(str(tmp_path / "region.png"), region.astype(np.uint8))
    words = ("recolour", "--hue", "120", "--region")
    found = edited(work / "ball", tmp_path / "found", *words, str(tmp_path / "region.png"))
    assert np.array_equal(
        found, edited(work / "ball", tmp_path / "wanted", *words, str(work / "region.png"))
    )


@pytest.mark.parametrize(
    ("option", "action"), [("--light", "relight"), ("--region", "recolour --hue 5")]
)
def test_what_is_read_is_never_replaced(
    work: Path, tmp_path: Path, option: str, action: str, capsys: pytest.CaptureFixture[str]
) -> None:
    edited(work / "ball", tmp_path / "out", "recolour", "--hue", "9")
    given = tmp_path / "out" / "edited.png"
    before = given.read_bytes()
    assert (
        main(
            [
                "edit",
                str(work / "ball"),
                *action.split(),
                option,
                str(given),
                "-o",
                str(tmp_path / "out"),
                "--quiet",
            ]
        )
        == 2
    )
    assert "lies in" in capsys.readouterr().err and given.read_bytes() == before


@pytest.mark.parametrize("damage", ["shading", "normal", "diffuse", "light"])
def test_a_damaged_result_is_named(
    work: Path, tmp_path: Path, damage: str, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(work / "ball", broken)
    if damage == "light":
        record = json.loads((broken / "decomposition.json").read_text())
        record["illumination"]["coefficients"] = (1e5 * LIGHT).tolist()
        (broken / "decomposition.json").write_text(json.dumps(record))
    else:
        channels = read_channels(broken / "maps.exr")
        write_channels(
            broken / "maps.exr",
            {
                name: (-1 if damage == "diffuse" else 0) * v if name.startswith(damage) else v
                for name, v in channels.items()
            },
        )
    for action in ("light-direction", "recolour --hue 5", "relight --yaw 10"):
        assert (
            main(["edit", str(broken), *action.split(), "-o", str(tmp_path / "out"), "--quiet"])
            == 2
        )
        error = capsys.readouterr().err
        assert "damaged" in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_quiet_is_heard_before_the_action_too(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        main(
            [
                "edit",
                "--quiet",
                str(work / "ball"),
                "relight",
                "--yaw",
                "30",
                "-o",
                str(tmp_path / "out"),
            ]
        )
        == 0
    )
    output = capsys.readouterr()
    assert not output.out and not output.err


def test_an_edit_without_effect_is_noted(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        main(["edit", str(work / "ball"), "recolour", "--hue", "360", "-o", str(tmp_path / "out")])
        == 0
    )
    assert "is unchanged" in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "edit.json").read_text())["notes"]


def test_every_action_explains_itself(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["edit", "--help"]) == 0
    actions = [action.split()[0] for action in ACTIONS]
    shown = capsys.readouterr().out
    assert all(action in shown for action in actions)
    for action in dict.fromkeys(actions):
        assert main(["edit", "anything", action, "--help"]) == 0
        shown = capsys.readouterr().out
        assert "--photo" in shown and "--output" in shown and "%(" not in shown
