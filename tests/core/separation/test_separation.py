"""The function `separate` for all methods, invalid input, and options on the command line."""

import json
import re
import subprocess
import sys
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
import pytest

from isc_core import separation
from isc_core.cli.main import main
from isc_core.datasets.highlight_set import load_shen_zheng
from isc_core.errors import Cancelled, InputError
from isc_core.evaluation.metrics import psnr
from isc_core.io.exr import read_channels
from isc_core.progress import Monitor
from isc_core.scene.decomposition import Separation
from isc_core.separation import METHODS, method_options, separate, variants
from isc_core.separation.option_text import parse_changes
from isc_core.separation.support import layers
from tests.core.command_line import ROOT, ball_codes, ball_photo, write_image


@dataclass(frozen=True)
class MadeOptions:
    levels: int = 2
    share: float = 0.5
    opening: bool = True
    optimiser: Literal["exact", "swarm"] = "exact"
    threshold: float | None = None
    name: str = "plain"


class MadeMethod:
    """A method whose answer shows what it was given: the specular layer is `share` of the smallest
    channel's mean over the whole array.
    """

    VARIANTS: ClassVar = {
        "improved": MadeOptions(),
        "paper": MadeOptions(share=0.25),
        "sihr": MadeOptions(share=0.1),
    }

    @staticmethod
    def separate(
        image: np.ndarray,
        mask: np.ndarray,
        options: MadeOptions | None = None,
        clipped: np.ndarray | None = None,
        monitor: Monitor | None = None,
    ) -> Separation:
        (monitor or Monitor()).report("making", 0.5)
        chosen = options or MadeOptions()
        return layers.white_layers(
            image,
            mask,
            np.full(mask.shape, chosen.share * float(np.nanmean(image.min(axis=2)))),
            clipped,
        )


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(separation, "METHODS", (*METHODS, "made"))
    monkeypatch.setitem(sys.modules, "isc_core.separation.made", MadeMethod)  # type: ignore[arg-type]
    return "made"


def framed() -> tuple[np.ndarray, np.ndarray]:
    """Half-bright inside the mask, bright outside."""
    mask = np.zeros((12, 14), bool)
    mask[3:9, 4:11] = True
    return np.where(mask[..., None], [0.6, 0.5, 0.4], 1.0), mask


def test_variants_and_changes_reach_the_method(made: str) -> None:
    image, mask = framed()
    for given, share in (
        ({}, 0.5),
        ({"variant": "paper"}, 0.25),
        ({"variant": "paper", "changes": {"share": 0.75}}, 0.75),
    ):
        assert separate(made, image, mask, **given).specular[mask] == pytest.approx(0.4 * share)  # type: ignore[arg-type]


def test_only_the_toolbox_looks_around_the_mask(made: str) -> None:
    image, mask = framed()
    split = separate(made, image, mask, variant="sihr")
    assert split.specular.shape == image.shape and not split.specular[~mask].any()
    assert split.specular[mask] == pytest.approx(0.1 * image.min(axis=2).mean())
    clipped = np.zeros_like(mask)
    clipped[5, 5] = True
    assert separate(made, image, mask, clipped, variant="sihr").confidence[5, 5] > 0
    assert separate(made, image, mask, clipped).confidence[5, 5] == 0


def test_progress_is_told_and_a_stop_is_heard(made: str) -> None:
    image, mask = framed()
    told = []
    separate(
        made, image, mask, monitor=Monitor(lambda event: told.append((event.stage, event.fraction)))
    )
    assert told == [("making", 0.5)]
    with pytest.raises(Cancelled):
        separate(made, image, mask, monitor=Monitor(cancelled=lambda: True))


def test_unknown_names_are_answered_with_the_known(made: str) -> None:
    image, mask = framed()
    with pytest.raises(
        InputError, match=r"unknown separation method 'magic': choose one of none, .*shen_2013"
    ):
        separate("magic", image, mask)
    with pytest.raises(
        InputError, match="made has no variant 'best': choose improved or paper or sihr"
    ):
        separate(made, image, mask, variant="best")
    with pytest.raises(
        InputError, match="made has no option 'level': choose one of levels, share, opening"
    ):
        separate(made, image, mask, changes={"level": 3})
    with pytest.raises(InputError, match="none has no option 'levels': it has none"):
        separate("none", image, mask, changes={"levels": 3})
    with pytest.raises(InputError, match="the mask is empty"):
        separate(made, image, np.zeros_like(mask))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_has_the_same_face(method: str) -> None:
    names = variants(method)
    assert names[0] == "improved" and set(names) <= {"improved", "paper", "sihr"}
    for name in names:
        options = method_options(method, name)
        if options is not None:
            text = type(options).__doc__ or ""
            documented = {
                name.strip()
                for line in re.findall(r"^    (\w[\w, ]*) : ", text, re.MULTILINE)
                for name in line.split(",")
            }
            assert {field.name for field in fields(options)} <= documented, method  # type: ignore[arg-type]
            changed = {field.name: getattr(options, field.name) for field in fields(options)}
            assert method_options(method, name, changed) == options
    if method_options(method) is not None:
        assert method_options(method) == type(method_options(method))(), (
            "the usual options are the improved variant"
        )


@pytest.mark.slow
def test_a_start_does_not_wait_for_the_methods() -> None:
    code = (
        "import sys; from isc_core.cli.main import main; main(['separate', '--help']); "
        "loaded = [k for k in sys.modules if k.startswith('isc_core.separation')]; "
        f"print([m for m in {METHODS[1:]!r} if any(k.endswith('.' + m) for k in loaded)], "
        "'numba' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[] False"


# --- options as text ------------------------------------------------------------------------------


def test_options_are_read_as_their_types(made: str) -> None:
    words = ["levels=3", "share= .25", "opening=no", "optimiser=swarm", "threshold=.7", "name=a=b"]
    changes = parse_changes(made, "paper", words)
    assert changes == {
        "levels": 3,
        "share": 0.25,
        "opening": False,
        "optimiser": "swarm",
        "threshold": 0.7,
        "name": "a=b",
    }
    assert [type(value) for value in changes.values()] == [int, float, bool, str, float, str]
    assert replace(MadeOptions(), **changes) == method_options(made, "paper", changes)
    assert parse_changes(made, words=["threshold=.7", "threshold=None"]) == {"threshold": None}
    assert parse_changes("none") == {}


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("levels", "--set levels: expected NAME=VALUE"),
        (
            "level=3",
            "made has no option 'level': choose one of levels, share, opening, optimiser, "
            "threshold, name",
        ),
        ("levels=3.5", "--set levels of made: '3.5' is not an integer"),
        ("share=nan", "'nan' is not a number"),
        ("share=", "'' is not a number"),
        ("opening=perhaps", "'perhaps' is not yes or no"),
        ("optimiser=luck", "'luck' is not one of exact, swarm"),
        ("threshold=low", "'low' is not a number or none"),
    ],
)
def test_options_that_cannot_be_read(made: str, word: str, message: str) -> None:
    with pytest.raises(InputError) as raised:
        parse_changes(made, words=[word])
    assert message in str(raised.value)


def test_the_command_chooses_variants_and_options(
    made: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("isc_core.cli.commands.separate.METHODS", separation.METHODS)
    photo, removed = str(write_image(tmp_path / "dim.png", ball_codes() // 2)), []
    for words in (
        (),
        ("--variant", "paper"),
        ("--variant", "paper", "--set", "levels=3", "--set", "share=0.125"),
    ):
        assert (
            main(
                [
                    "separate",
                    photo,
                    "--method",
                    made,
                    *words,
                    "--quiet",
                    "-o",
                    str(tmp_path / "out"),
                ]
            )
            == 0
        )
        removed.append(read_channels(tmp_path / "out" / "separation.exr")["specular.G"].max())
    assert removed[0] > 0 and removed == pytest.approx([removed[0], removed[0] / 2, removed[0] / 4])


# Its starts are random: its own test checks the figure.
RANDOM = {"akashi_2016"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", sorted({method for method in METHODS if "sihr" in variants(method)} - RANDOM)
)
def test_the_command_finds_the_toolbox_figures(shared: Path, tmp_path: Path, method: str) -> None:
    """PSNR of the diffuse layer, whole frame, stored values: within .2 dB of what the toolbox
    itself was measured at.
    """
    folder = shared / "data" / "highlight"
    anchors = json.loads((shared / "anchors" / "specular_removal.json").read_text())["shen"]
    command = [
        "separate",
        str(folder / "animals.bmp"),
        "--transfer",
        "linear",
        "--method",
        method,
        "--variant",
        "sihr",
        "--whole",
        "--quiet",
    ]
    assert main([*command, "-o", str(tmp_path / "out")]) == 0
    maps = read_channels(tmp_path / "out" / "separation.exr")
    diffuse = np.stack([maps[f"diffuse.{c}"] for c in "RGB"], -1)
    measured = anchors["animals"][method.replace("_", "").capitalize()]["psnr"]
    assert psnr(load_shen_zheng(folder, "animals").diffuse, diffuse) == pytest.approx(
        measured, abs=0.2
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [(("--variant", "best"), "no variant 'best'"), (("--set", "speed=9"), "no option 'speed'")],
)
def test_the_command_refuses_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], words: tuple[str, ...], message: str
) -> None:
    assert (
        main(
            [
                "separate",
                str(ball_photo(tmp_path)),
                "--method",
                "shen_2013",
                *words,
                "-o",
                str(tmp_path / "out"),
            ]
        )
        == 2
    )
    error = capfd.readouterr().err
    assert message in error and error.count("\n") == 1 and not (tmp_path / "out").exists()


def test_a_ramp_is_written_as_two_numbers() -> None:
    assert parse_changes("isc", words=["smooth=0.5, 0.4"]) == {"smooth": (0.5, 0.4)}
    for text in ("smooth=0.5", "smooth=0.5,0.4,0.3", "smooth=a,b", "smooth=0.5,"):
        with pytest.raises(InputError, match="2 comma-separated numbers"):
            parse_changes("isc", words=[text])
