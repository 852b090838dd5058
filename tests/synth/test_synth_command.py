"""The command `isc synth` as a user calls it, and the discovery of commands of other packages."""

import json
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from isc_core.cli import commands
from isc_core.cli.main import main
from isc_core.extras import install_command
from isc_core.io.exr import write_channels

ROOT = Path(__file__).resolve().parents[2]
QUICK = (
    "--size",
    "32",
    "--samples",
    "4",
    "--renderer",
    "arrays",
    "--shapes",
    "superquadric",
    "--albedos",
    "uniform",
    "--quiet",
)
TETRAHEDRON = "v 1 1 1\nv -1 -1 1\nv -1 1 -1\nv 1 -1 -1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def synth(out: Path | None, *arguments: str, count: int = 1) -> int:
    return main(
        ["synth", "--count", str(count), *arguments, *(() if out is None else ("-o", str(out)))]
    )


def refusal(capsys: pytest.CaptureFixture[str]) -> str:
    """The line on stderr without its prefix."""
    lines = [line for line in capsys.readouterr().err.splitlines() if "libLLVM" not in line]
    assert len(lines) == 1 and lines[0].startswith("isc: error: "), lines
    return lines[0].removeprefix("isc: error: ")


def isolated(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    start = f"import sys; sys.modules['mitsuba'] = sys.modules['drjit'] = None; {code}"
    return subprocess.run(
        [sys.executable, "-c", start, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_help_needs_no_mitsuba_and_running_prints_what_to_install(tmp_path: Path) -> None:
    start = "from isc_core.cli.main import main; sys.exit(main(sys.argv[1:]))"
    shown = isolated(start, "synth", "--help")
    assert shown.returncode == 0, shown.stderr
    assert {"--count", "--natural-lights", "--renderer"} <= set(
        shown.stdout.replace(",", " ").split()
    )
    refused = isolated(start, "synth", "--count", "1", "-o", str(tmp_path / "set"))
    assert refused.returncode == 2
    assert (
        refused.stderr
        == f"isc: error: rendering needs Mitsuba: install it with `{install_command('synth')}`\n"
    )
    assert not (tmp_path / "set").exists()


@pytest.mark.slow
def test_the_parser_loads_no_renderer() -> None:
    code = (
        "import sys; from isc_core.cli.commands import build_parser; build_parser(); "
        "sys.exit(bool({'mitsuba', 'drjit'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def install(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    """Make `value` the only entry point of another package's command, named paint."""
    found = [EntryPoint("paint", value, "isc.commands")]
    monkeypatch.setattr(
        "importlib.metadata.entry_points", lambda group: found if group == "isc.commands" else []
    )


@pytest.mark.parametrize("value", ["no_such_package:PAINT", "paint_entry:PAINT"])
def test_a_command_that_cannot_be_imported_refuses_alone(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    value: str,
) -> None:
    (tmp_path / "paint_entry.py").write_text(
        "from isc_core.cli.commands.registry import CommandEntry\n"
        "PAINT = CommandEntry('paint', 'another coat', 'no_such_package.paint', 'synth')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    install(monkeypatch, value)
    assert main(["--help"]) == 0
    assert "paint" in capsys.readouterr().out
    assert main(["separate", "--help"]) == 0
    capsys.readouterr()
    advice = f": install it with `{install_command('synth')}`" if "entry" in value else ""
    for arguments in ([], ["--help"], ["photo.png", "--json", "x", "-o", "y"]):
        assert main(["paint", *arguments]) == 2
        assert refusal(capsys).endswith(
            f"isc paint is not available (No module named 'no_such_package'){advice}"
        )


def test_an_error_inside_a_command_is_not_taken_for_a_missing_package(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "broken_command.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    install(monkeypatch, "broken_command:PAINT")
    with pytest.raises(ZeroDivisionError):
        commands.build_parser()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--shapes", "teapot"), "unknown shape 'teapot': choose superquadric"),
        (("--materials", "ggx,velvet"), "unknown material 'velvet': choose lambert"),
        (("--albedos", "tartan"), "unknown albedo 'tartan'"),
        (("--lights", "laser"), "unknown light 'laser'"),
        (("--splits", "dev"), "unknown split 'dev'"),
        (("--lights", "natural"), "read from files: give the folder of natural_lights.mat"),
        (("--shapes", "mesh"), "give --mesh FILE"),
        (("--size", "4"), "choose 8 to 4096"),
        (("--size", "9999"), "choose 8 to 4096"),
        (("--size", "-5"), "is not a whole number"),
        (("--samples", "1"), "at least 2 samples"),
        (("--bounces", "99"), "0 to 8 bounces"),
        (("--seed", "99999", "--count", "2"), "not possible"),
        (("--count", "0"), "not possible"),
        (("--count", "many"), "not a whole number"),
        (("--exposure", "0"), "--exposure"),
        (("--noise", "2"), "from 0 to below 1"),
        (("--bits", "12"), "--bits"),
        (("--renderer", "oil"), "--renderer"),
        (("--mesh", "nowhere.obj"), "nowhere.obj does not exist"),
        (("--albedo-image", "nowhere.png"), "nowhere.png does not exist"),
        (("--hdr", "nowhere"), "nowhere"),
        (("--natural-lights", "nowhere"), "nowhere"),
        (("--mesh", __file__), "meshes are read from"),
        (("--albedo-image", __file__), __file__),
        (("--shapes", "lathe", "--albedos", "mesh"), "no colours of its own"),
        (("bake",), "invalid choice: 'bake'"),
    ],
)
def test_bad_input_ends_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], message: str
) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    assert synth(tmp_path / "set", *arguments) == 2
    assert message in refusal(capsys)
    assert not (tmp_path / "set").exists()


def test_a_folder_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    assert synth(None) == 2
    assert "isc synth -o DIR" in refusal(capsys)


def test_a_run_makes_scenes_and_can_be_continued(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    out = tmp_path / "set"
    loud = [argument for argument in QUICK if argument != "--quiet"]
    assert synth(out, *loud, "--bits", "8", "--noise", "0.01") == 0
    shown = capsys.readouterr()
    assert (
        "1 scenes rendered" in shown.out
        and "README.md" in shown.out
        and "isc: scene 1 of 1" in shown.err
    )
    assert synth(out, *loud, "--bits", "8", "--noise", "0.01", count=2) == 0
    assert "1 scenes rendered, 1 kept" in capsys.readouterr().out
    assert synth(out, *loud, "--bits", "16", "--noise", "0.01", count=2) == 2
    assert "another run (sensor" in refusal(capsys)
    picture = json.loads(next(out.glob("train/*/scene.json")).read_text())["picture"]
    assert picture["sensor"] == {"clip": True, "noise": 0.01, "bits": 8}, "codes imply clipping"


@pytest.mark.slow
@pytest.mark.parametrize("quiet", [False, True])
def test_slow_rendering_is_explained_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, quiet: bool
) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    monkeypatch.setattr(
        "synth.commands.synth.slower_without", lambda: "libLLVM 15 is too old: install libllvm19"
    )
    assert synth(tmp_path / "set", *(QUICK if quiet else QUICK[:-1])) == 0
    assert capsys.readouterr().err.count("isc: libLLVM 15 is too old: install libllvm19\n") == (
        not quiet
    )


@pytest.mark.slow
def test_the_command_in_the_readme_makes_the_same_scenes(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    assert (
        synth(
            tmp_path / "one",
            *QUICK,
            "--exposure",
            "0.4",
            "--clip",
            "--lights",
            "sh",
            "--perspective",
        )
        == 0
    )
    line = next(
        line.strip()
        for line in (tmp_path / "one" / "README.md").read_text().splitlines()
        if line.startswith("    isc synth")
    )
    assert main([*line.replace("DIR", str(tmp_path / "other")).split()[1:], "--quiet"]) == 0
    ours, theirs = (next((tmp_path / name).glob("*/*/scene.json")) for name in ("one", "other"))
    assert ours.read_bytes() == theirs.read_bytes()


@pytest.mark.slow
def test_files_of_the_user_come_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    (tmp_path / "solid.obj").write_text(TETRAHEDRON)
    assert (
        synth(tmp_path / "set", "--mesh", str(tmp_path / "solid.obj"), "--splits", "test_objects")
        == 2
    )
    assert "test_objects is not possible" in refusal(capsys)
    sky = np.full((8, 16), 0.5, np.float32)
    (tmp_path / "lights").mkdir()
    write_channels(tmp_path / "lights" / "sky.exr", {"R": sky, "G": sky, "B": sky})
    paint = np.full((16, 16), 0.25, np.float32)
    write_channels(tmp_path / "paint.exr", {"R": paint, "G": 2 * paint, "B": paint})
    files = {"--mesh": "solid.obj", "--albedo-image": "paint.exr", "--hdr": "lights"}
    given = [word for option, name in files.items() for word in (option, str(tmp_path / name))]
    assert synth(tmp_path / "set", *QUICK[:6], "--lights", "hdr", "--quiet", *given) == 0
    folder = next((tmp_path / "set").glob("train/*"))
    content = json.loads((folder / "scene.json").read_text())
    assert content["object"]["id"] == "mesh00" and content["light"]["id"] == "hdr00"
    assert "_image0" in content["material"]["id"]
    assert np.allclose(content["albedo"]["mean"], (0.25, 0.5, 0.25), atol=1e-3)
    text = (
        (tmp_path / "set" / "README.md").read_text()
        + (tmp_path / "set" / "manifest.json").read_text()
        + json.dumps(content)
    )
    assert str(tmp_path) not in text and "derived from them" in text


@pytest.mark.slow
def test_a_textured_mesh_keeps_its_albedo(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    (tmp_path / "solid.obj").write_text("mtllib solid.mtl\nusemtl red\n" + TETRAHEDRON)
    (tmp_path / "solid.mtl").write_text("newmtl red\nKd 0.5 0.1 0.1\n")
    assert (
        synth(tmp_path / "set", *QUICK[:6], "--quiet", "--mesh", str(tmp_path / "solid.obj")) == 0
    )
    content = json.loads(next((tmp_path / "set").glob("train/*/scene.json")).read_text())
    red, green, blue = content["albedo"]["mean"]
    assert (
        content["albedo"]["family"] == "mesh" and red > 2 * green and green == pytest.approx(blue)
    )


@pytest.mark.slow
def test_interrupting_ends_with_130(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba", reason="needs the extra `synth`")
    code = "import sys; from isc_core.cli.main import main; sys.exit(main(sys.argv[1:]))"
    arguments = [
        "synth",
        "--count",
        "50",
        "-o",
        str(tmp_path / "set"),
        *(a for a in QUICK if a != "--quiet"),
    ]
    process = subprocess.Popen(
        [sys.executable, "-c", code, *arguments], cwd=ROOT, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "scene 2 of 50" in line:
            process.send_signal(2)
            break
    rest = process.stderr.read()
    assert process.wait() == 130 and rest.splitlines()[-1] == "isc: cancelled"
    assert not list((tmp_path / "set").rglob("*partial*"))
    finished = list((tmp_path / "set").glob("*/*/scene.json"))
    assert 1 <= len(finished) <= 3
