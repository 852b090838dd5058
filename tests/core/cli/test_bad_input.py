"""Unusable input ends in one clear line and exit code 2: no traceback, no partial result."""

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from isc_core.cli.interface.values import memory_size
from isc_core.cli.main import main
from isc_core.io.exr import write_channels
from tests.core.command_line import ball_codes, ball_photo, run_isc, write_image

Maker = Callable[[Path], list[object]]


def one_line(text: str) -> str:
    """The message of a refused command, which is all that it wrote to standard error."""
    assert text.count("\n") == 1 and text.startswith("isc: error: "), text
    assert "Traceback" not in text
    return text


def refused(capfd: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Runs a command in this process and returns its message.

    What C libraries write themselves would count as well.
    """
    code = main([str(argument) for argument in arguments])
    out, err = capfd.readouterr()
    assert code == 2, (code, out, err)
    assert out == ""
    return one_line(err)


def disc() -> np.ndarray:
    rows, columns = np.mgrid[:60, :60]
    return np.where(np.hypot(rows - 30, columns - 30) < 20, 255, 0).astype(np.uint8)


def write_bytes(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def exr_with(value: float) -> Maker:
    def make(folder: Path) -> list[object]:
        mask = disc()
        pixels = np.where(mask > 0, np.linspace(0.1, 0.9, 60), 0).astype(np.float32)
        pixels[30, 30] = value
        write_channels(folder / "photo.exr", dict.fromkeys("RGB", pixels))
        return [folder / "photo.exr", "--mask", write_image(folder / "mask.png", mask)]

    return make


def truncated(folder: Path) -> list[object]:
    whole = ball_photo(folder).read_bytes()
    return [write_bytes(folder / "cut.png", whole[: len(whole) // 2])]


def cmyk(folder: Path) -> list[object]:
    Image.fromarray((ball_codes() >> 8).astype(np.uint8)).convert("CMYK").save(folder / "print.jpg")
    return [folder / "print.jpg"]


def with_mask(make_mask: Callable[[tuple[int, ...]], np.ndarray]) -> Maker:
    return lambda folder: [
        ball_photo(folder),
        "--mask",
        write_image(folder / "mask.png", make_mask(ball_codes().shape[:2])),
    ]


def three_pixels(shape: tuple[int, ...]) -> np.ndarray:
    mask = np.zeros(shape, np.uint8)
    mask[20, 20:23] = 255
    return mask


def picture(pixels: np.ndarray) -> Maker:
    return lambda folder: [write_image(folder / "picture.png", pixels)]


def constant(folder: Path) -> list[object]:
    return [
        write_image(folder / "grey.png", np.full((60, 60, 3), 90, np.uint8)),
        "--mask",
        write_image(folder / "mask.png", disc()),
    ]


def hidden(folder: Path) -> list[object]:
    if os.geteuid() == 0:
        pytest.skip("the superuser can read every file")
    path = ball_photo(folder)
    path.chmod(0)
    return [path]


PHOTOS: dict[str, tuple[Maker, str]] = {
    "missing file": (lambda folder: [folder / "nowhere.png"], "no such file"),
    "unreadable file": (hidden, "cannot be read"),
    "folder": (lambda folder: [folder], "folder"),
    "empty file": (lambda folder: [write_bytes(folder / "empty.png", b"")], "empty"),
    "text named png": (
        lambda folder: [write_bytes(folder / "letter.png", b"Dear all,\nno picture here.\n")],
        "not an image",
    ),
    "device": (lambda folder: ["/dev/null"], "not a regular file"),
    "truncated png": (truncated, "damaged"),
    "mask of another size": (
        with_mask(lambda shape: np.full((shape[0] + 1, shape[1]), 255, np.uint8)),
        "photo's size",
    ),
    "empty mask": (with_mask(lambda shape: np.zeros(shape, np.uint8)), "empty"),
    "mask of three pixels": (with_mask(three_pixels), "3 pixels"),
    "missing mask": (
        lambda folder: [ball_photo(folder), "--mask", folder / "no-mask.png"],
        "no such file",
    ),
    "NaN": (exr_with(np.nan), "NaN"),
    "infinite": (exr_with(np.inf), "infinite"),
    "negative": (exr_with(-0.5), "negative"),
    "constant": (constant, "the same"),
    "all black": (picture(np.zeros((60, 60, 3), np.uint8)), "black"),
    "one pixel wide": (picture(np.full((60, 1, 3), 90, np.uint8)), "1 x 60"),
    "60000 x 10": (
        picture(np.tile(np.arange(60000, dtype=np.uint16)[:, None], (10, 1, 3))),
        "60000 x 10",
    ),
    "CMYK jpeg": (cmyk, "CMYK"),
}


@pytest.mark.parametrize("case", PHOTOS)
@pytest.mark.parametrize("command", [("decompose",), ("separate",)], ids=["decompose", "separate"])
def test_a_photo_that_cannot_be_used(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], case: str, command: tuple[str, ...]
) -> None:
    make, words = PHOTOS[case]
    message = refused(capfd, *command, *make(tmp_path), "-o", tmp_path / "out" / "result")
    assert words in message
    assert not (tmp_path / "out").exists()
    assert not list(tmp_path.glob(".*"))


@pytest.mark.slow
@pytest.mark.parametrize("case", ["missing file", "truncated png", "NaN", "CMYK jpeg"])
def test_the_same_in_a_process_of_its_own(tmp_path: Path, case: str) -> None:
    make, words = PHOTOS[case]
    done = run_isc("decompose", *make(tmp_path), "-o", tmp_path / "out")
    assert (done.returncode, done.stdout) == (2, "")
    assert words in one_line(done.stderr)
    assert not (tmp_path / "out").exists()


def test_a_photo_without_a_mask_names_the_remedy(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    photo = write_image(
        tmp_path / "full.png", np.arange(60 * 60 * 3, dtype=np.uint16).reshape(60, 60, 3) + 9000
    )
    assert "--point x,y" in refused(capfd, "decompose", photo, "-o", tmp_path / "out")


def test_a_palette_picture_can_be_used(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    coded = Image.fromarray((ball_codes() >> 8).astype(np.uint8)).quantize(64)
    coded.save(tmp_path / "palette.png")
    assert coded.mode == "P"
    code = main(
        [
            "decompose",
            str(tmp_path / "palette.png"),
            "--model",
            "naive",
            "-o",
            str(tmp_path / "out"),
        ]
    )
    assert code == 0, capfd.readouterr().err
    assert (tmp_path / "out" / "decomposition.json").is_file()


# --- where the result goes ------------------------------------------------------------------------


def test_a_folder_below_a_file(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    photo = ball_photo(tmp_path)
    assert "not a folder" in refused(capfd, "decompose", photo, "-o", photo / "result")


def test_a_file_instead_of_a_folder(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    photo = ball_photo(tmp_path)
    before = photo.read_bytes()
    assert "choose a folder" in refused(capfd, "decompose", photo, "-o", photo)
    assert photo.read_bytes() == before


def test_a_file_instead_of_a_cache(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    photo, output = ball_photo(tmp_path), tmp_path / "out"
    text = refused(capfd, "decompose", photo, "--cache", photo, "-o", output)
    assert "is a file: name a folder" in text and not output.exists()


def test_a_foreign_folder(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "letters").mkdir()
    letter = tmp_path / "letters" / "letter.txt"
    letter.write_text("mine")
    assert "not empty" in refused(
        capfd, "decompose", ball_photo(tmp_path), "-o", tmp_path / "letters"
    )
    assert letter.read_text() == "mine"


def test_a_folder_that_cannot_be_written(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "locked"
    place.mkdir()
    place.chmod(0o555)
    if os.access(place, os.W_OK):  # the superuser writes anywhere but here
        place = Path("/proc")
        if not place.is_dir():
            pytest.skip("the superuser can write to every folder")
    assert "cannot write" in refused(
        capfd, "decompose", ball_photo(tmp_path), "-o", place / "result"
    )
    assert "cannot" in refused(
        capfd, "mask", ball_photo(tmp_path), "--box", "5,5,44,42", "-o", place / "mask.png"
    )


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """Mounts a disk of so many kilobytes in memory."""
    mounted: list[Path] = []

    def mount(kilobytes: int) -> Path:
        place = tmp_path / "disk"
        place.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(place)]
        try:
            if subprocess.run(command, capture_output=True, check=False).returncode:
                pytest.skip("mounting a small disk needs rights that this user does not have")
        except FileNotFoundError:
            pytest.skip("there is no mount command here")
        mounted.append(place)
        return place

    yield mount
    for place in mounted:
        subprocess.run(["umount", str(place)], capture_output=True, check=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [("decompose", "--model", "naive"), ("separate", "--method", "none")],
    ids=["decompose", "separate"],
)
@pytest.mark.parametrize("kilobytes", [4, 64])
def test_a_full_disk(
    tmp_path: Path, small_disk: Callable[[int], Path], command: tuple[str, ...], kilobytes: int
) -> None:
    place = small_disk(kilobytes)
    done = run_isc(*command, ball_photo(tmp_path), "--quiet", "-o", place / "result")
    assert done.returncode == 2, done.stderr
    assert "no space is left" in one_line(done.stderr)
    assert not list(place.iterdir())


@pytest.mark.slow
def test_a_disk_that_fills_up_while_writing(tmp_path: Path) -> None:
    """A limit on the size of files fails in the same place as a disk that fills up, and needs no
    rights.
    """
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))"
    done = run_isc(
        "decompose",
        ball_photo(tmp_path),
        "--model",
        "naive",
        "--quiet",
        "-o",
        tmp_path / "result",
        before=limit,
    )
    assert done.returncode == 2, done.stderr
    assert "cannot write" in one_line(done.stderr)
    assert [entry.name for entry in tmp_path.iterdir()] == ["ball.png"]


# --- options --------------------------------------------------------------------------------------

DECOMPOSE = ("decompose", "PHOTO", "-o", "OUT")
MASK = ("mask", "PHOTO", "-o", "OUT.png")
OPTIONS = [
    (DECOMPOSE, ("--model", "guess"), "guess"),
    (DECOMPOSE, ("--separator", "guess"), "shen_2013"),
    (DECOMPOSE, ("--illumination", "moon"), "natural"),
    (DECOMPOSE, ("--transfer", "gamma"), "linear"),
    (DECOMPOSE, ("--engine", "gpu"), "numba"),
    (DECOMPOSE, ("--max-size", "-1"), "--max-size"),
    (DECOMPOSE, ("--max-size", "big"), "'big'"),
    (DECOMPOSE, ("--max-size", "5"), "--max-size"),
    (DECOMPOSE, ("--threads", "-2"), "--threads"),
    (DECOMPOSE, ("--seed", "1.5"), "--seed"),
    (DECOMPOSE, ("--depth-sigma", "0"), "--depth-sigma"),
    (DECOMPOSE, ("--depth-weight", "nan"), "--depth-weight"),
    (DECOMPOSE, ("--height-scale", "inf"), "--height-scale"),
    (DECOMPOSE, ("--model", "naive", "--shading-only"), "--shading-only"),
    (DECOMPOSE, ("--models", "mdr"), "--models"),
    (DECOMPOSE, ("--mod", "mdr"), "--mod"),
    (DECOMPOSE, ("another.png",), "another.png"),
    (DECOMPOSE, ("--mask",), "--mask"),
    (("decompose", "PHOTO"), (), "--output"),
    (("decompose", "-o", "OUT"), (), "PHOTO"),
    ((), (), "COMMAND"),
    (("decompos", "PHOTO"), (), "decompos"),
    (("separate", "PHOTO", "-o", "OUT"), ("--method", "guess"), "shen_2013"),
    (("separate", "PHOTO", "-o", "OUT"), ("--prior", "nothing.png"), "no such file"),
    (("separate", "PHOTO", "-o", "OUT"), ("--prior",), "--prior"),
    (("separate", "PHOTO", "-o", "OUT", "--mask", "PHOTO"), ("--whole",), "leave out --mask"),
    (
        ("separate", "PHOTO", "--method", "shen_2013", "--prior", "PHOTO", "-o", "OUT"),
        (),
        "--prior requires --method isc",
    ),
    (MASK, ("--box", "1,2,3"), "x,y,w,h"),
    (MASK, ("--box", "a,b,c,d"), "x,y,w,h"),
    (MASK, ("--box", "40,40,400,400"), "inside"),
    (MASK, ("--box", "1,1,2,2"), "8 pixels"),
    (("mask", "PHOTO", "-o", "OUT.jpg"), ("--box", "5,5,44,42"), ".png"),
    (("evaluate", "NOWHERE"), ("--dataset", "guess"), "mit-berkeley"),
    (("evaluate", "NOWHERE"), ("--dataset", "mit-berkeley"), "MIT-Berkeley"),
    (("evaluate", "NOWHERE"), ("--dataset", "mit-berkeley", "--model", "guess"), "joint"),
    (("evaluate", "NOWHERE"), ("--dataset", "mit-berkeley", "--objects", ","), "--objects"),
    (("fit-priors", "NOWHERE", "-o", "OUT.npz"), (), "MIT-Berkeley"),
    (
        ("fit-priors", "NOWHERE", "-o", "OUT.npz"),
        ("--objects", "a,b", "--leave-out", "c"),
        "not allowed",
    ),
]


@pytest.mark.parametrize(
    ("command", "options", "words"),
    OPTIONS,
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_an_option_that_means_nothing(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    command: tuple[str, ...],
    options: tuple[str, ...],
    words: str,
) -> None:
    places = {"PHOTO": ball_photo(tmp_path), "NOWHERE": tmp_path / "nowhere"}
    places |= {name: tmp_path / "made" / name for name in ("OUT", "OUT.png", "OUT.jpg", "OUT.npz")}
    message = refused(capfd, *(places.get(word, word) for word in command), *options)
    assert words in message
    assert [entry.name for entry in tmp_path.iterdir()] == ["ball.png"]


# --- known inputs ---------------------------------------------------------------------------------


def saved(
    name: str, array: np.ndarray, *, pickled: bool = False
) -> Callable[[Path, tuple[int, ...]], Path]:
    def make(folder: Path, shape: tuple[int, ...]) -> Path:
        np.save(folder / name, array, allow_pickle=pickled)
        return folder / name

    return make


def of_shape(fill: float) -> Callable[[Path, tuple[int, ...]], Path]:
    return lambda folder, shape: saved("map.npy", np.full(shape, fill))(folder, shape)


def written(name: str, data: bytes) -> Callable[[Path, tuple[int, ...]], Path]:
    return lambda folder, shape: write_bytes(folder / name, data)


def with_hole(folder: Path, shape: tuple[int, ...]) -> Path:
    height = np.zeros(shape)
    height[shape[0] // 2, shape[1] // 2] = np.nan
    return saved("hole.npy", height)(folder, shape)


def beside(folder: Path, shape: tuple[int, ...]) -> Path:
    height = np.full(shape, np.nan)
    height[0] = 5.0
    return saved("beside.npy", height)(folder, shape)


def eight_bits(folder: Path, shape: tuple[int, ...]) -> Path:
    return write_image(folder / "flat.png", np.full(shape, 9, np.uint8))


EVIDENCE = {
    "shape missing": ("--shape", lambda folder, shape: folder / "nowhere.exr", "No such file"),
    "shape of another size": ("--shape", saved("small.npy", np.zeros((9, 9))), "photo's size"),
    "shape with a hole": ("--shape", with_hole, "--depth"),
    "shape of 8 bits": ("--shape", eight_bits, "16"),
    "shape of three numbers a pixel": ("--shape", saved("cube.npy", np.zeros((9, 9, 3))), "(H, W)"),
    "shape of objects": (
        "--shape",
        saved("object.npy", np.array([[{}]], dtype=object), pickled=True),
        "objects",
    ),
    "shape cut short": ("--shape", written("cut.npy", b"\x93NUMPY\x01\x00v"), "damaged"),
    "shape that is no result": ("--shape", lambda folder, shape: folder, "not a result folder"),
    "depth of holes": ("--depth", of_shape(np.nan), "holes"),
    "depth of something else": ("--depth", beside, "inside the mask"),
    "depth that is text": ("--depth", written("depth.png", b"deep\n"), "not an image"),
    "light missing": ("--light", lambda folder, shape: folder / "nowhere.json", "No such file"),
    "light that is text": ("--light", written("light.json", b"bright\n"), "JSON"),
    "light of 9 numbers": (
        "--light",
        written("light.json", b"[1, 2, 3, 4, 5, 6, 7, 8, 9]"),
        "9 lists of 3",
    ),
    "light without end": (
        "--light",
        written("light.json", str([[float("nan")] * 3] * 9).replace("nan", "NaN").encode()),
        "9 lists of 3",
    ),
    "priors that are text": ("--priors", written("priors.npz", b"likely\n"), "priors"),
    "priors missing": ("--priors", lambda folder, shape: folder / "nowhere.npz", "No such file"),
}


@pytest.mark.parametrize("case", EVIDENCE)
def test_evidence_that_cannot_be_used(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    option, make, words = EVIDENCE[case]
    photo = ball_photo(tmp_path)
    path = make(tmp_path, ball_codes().shape[:2])
    message = refused(capfd, "decompose", photo, option, path, "--quiet", "-o", tmp_path / "result")
    assert words in message
    assert not (tmp_path / "result").exists()


def test_a_name_with_a_line_break_stays_on_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert "no such file" in refused(
        capfd, "decompose", tmp_path / "two\nlines.png", "-o", tmp_path / "result"
    )


def test_the_reference_of_these_tests_is_usable() -> None:
    """If the ball itself were rejected, every test above would pass vacuously."""
    codes = ball_codes()
    assert (
        codes.dtype == np.uint16
        and 1000 < np.count_nonzero(codes.max(-1)) < codes.shape[0] * codes.shape[1]
    )
    assert cv2.__version__


@pytest.mark.parametrize(
    ("size", "message"),
    [
        (
            "80MB",
            "pixels to decompose need about 0.3 GB of memory, more than the 80.0 MB of --memory",
        ),
        ("80", "'80' is not an amount of memory, such as 2GB"),
        ("0GB", "'0GB' is not an amount of memory"),
        ("some", "'some' is not an amount of memory"),
    ],
)
def test_memory_that_is_too_little_or_none(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], size: str, message: str
) -> None:
    photo, output = write_image(tmp_path / "photo.png", ball_codes()), tmp_path / "result"
    said = refused(capfd, "decompose", photo, "-o", output, "--memory", size)
    assert message in said
    assert not output.exists()


def test_amounts_of_memory() -> None:
    sizes = {"2GB": 2 * 10**9, "1.5 gib": 3 << 29, "800 MB": 8 * 10**8, "512B": 512}
    assert {text: memory_size(text) for text in sizes} == sizes
