"""Names of results are safe, unique, and independent of the order."""

import os
import random
from pathlib import Path, PurePath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from isc_core.batch.item import BatchItem, ImageRecipe
from isc_core.batch.names import OWN_FILES, Names, check_given, safe_name, wanted_name
from isc_core.batch.sources import Inputs
from isc_core.errors import InputError

ANY_NAME = st.text(st.characters(codec=None), max_size=300) | st.binary(max_size=300).map(
    os.fsdecode
)
HOSTILE = [
    "",
    ".",
    "..",
    "...",
    "../x",
    "/etc/passwd",
    "a/../../b",
    "a\\b",
    "\0",
    "a\0b",
    "con",
    "NUL.txt",
    "-rf",
    ".hidden",
    "Summary.html",
]


def is_safe(name: str) -> bool:
    """Whether any system accepts it as the name of a folder, and the run itself does not use it."""
    return (
        0 < len(name.encode("utf-8")) <= 130
        and not set(name) & set('/\\\0<>:"|?*\n\r ')
        and not name.startswith((".", "-"))
        and not name.endswith((".", " "))
        and name.casefold() not in OWN_FILES
        and name.partition(".")[0].casefold() not in ("con", "nul", "aux", "prn", "com1")
    )


@given(ANY_NAME)
def test_any_text_becomes_a_safe_name(text: str) -> None:
    name = safe_name(text)
    assert is_safe(name)
    assert safe_name(name) == name


@pytest.mark.parametrize("text", [*HOSTILE, *OWN_FILES])
def test_hostile_names_become_safe(text: str) -> None:
    assert is_safe(safe_name(text))


def test_usual_names_stay() -> None:
    for name in ("cup", "IMG_0001", "tasse-blau.2", "чашка", "杯子"):
        assert safe_name(name) == name


@pytest.mark.parametrize(
    "name",
    [
        "..",
        ".",
        "/abs",
        "a/b",
        "a\\b",
        "x\0y",
        "x\ny",
        "nul",
        "COM1.png",
        "thumbnails",
        "Failures.jsonl",
        " ",
    ],
)
def test_a_manifest_cannot_give_names_that_lead_elsewhere(name: str) -> None:
    with pytest.raises(InputError, match="^here: "):
        check_given(name, "here")


def test_equal_names_are_made_unique_in_any_order() -> None:
    items = [BatchItem(f"{folder}/front.png") for folder in "abcdefgh"] + [
        BatchItem("a/Front.jpg"),
        BatchItem("a/back.png"),
        BatchItem("x", name="BACK"),
    ]
    names = Names(items)
    given_names = {item: names.name(item) for item in items}
    assert len({str(name).casefold() for name in given_names.values()}) == len(items) == names.count
    assert all(
        name is not None
        and is_safe(name)
        and name.casefold().startswith(wanted_name(item).casefold()[:4])
        for item, name in given_names.items()
    )
    shuffled = items[:]
    random.Random(1).shuffle(shuffled)
    again = Names(shuffled)
    assert {item: again.name(item) for item in shuffled} == given_names


def test_a_unique_name_is_that_of_the_file() -> None:
    item = BatchItem("photos/cup.png")
    assert Names([item, BatchItem("photos/jug.png")]).name(item) == "cup"


def test_a_file_cannot_collide_with_a_hashed_name() -> None:
    pair = [BatchItem("a/cup.png"), BatchItem("b/cup.png")]
    taken = str(Names(pair).name(pair[0]))
    three = [*pair, BatchItem(f"c/{taken}.png")]
    names = Names(three)
    assert len({names.name(item) for item in three}) == 3


def test_the_same_item_has_one_result() -> None:
    item, other = BatchItem("a/cup.png"), BatchItem("a/cup.png", options=(("max_size", 64),))
    names = Names([item, other, item])
    first, second = names.name(item), names.name(other)
    assert None not in (first, second) and first != second
    assert names.name(item) is None


def test_names_lead_into_the_output(tmp_path: Path) -> None:
    for text in HOSTILE:
        folder = (tmp_path / safe_name(text)).resolve()
        assert folder.parent == tmp_path.resolve()


def test_photos_of_phones_and_cameras_are_found_in_a_folder(tmp_path: Path) -> None:
    for name in ("a.HEIC", "b.dng", "c.avif", "d.txt", "b_mask.png"):
        (tmp_path / name).write_bytes(b"x")
    found = list(Inputs([str(tmp_path)], None, ImageRecipe()))
    assert [PurePath(item.image).name for item in found] == ["a.HEIC", "b.dng", "c.avif"]
    assert [PurePath(item.mask).name for item in found] == ["", "b_mask.png", ""]


def test_a_pattern_does_not_match_what_runs_have_written(tmp_path: Path) -> None:
    out = tmp_path / "out"
    photos = ["cat/cup.jpg", "cup.jpg", "out/more/jug.jpg"]
    made = ["out/cup/preview.jpg", "out/cup/maps/a.jpg", "out/shelf/1/a.jpg"]
    thumbnails = ["out/thumbnails/cup.jpg", "out/thumbnails/each/shelf/1.jpg"]
    for name in (*photos, *made, *thumbnails):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    for result in ("cup", "shelf/1"):
        (out / result / "decomposition.json").touch()
    pattern = f"{tmp_path}/**/*.jpg"
    found = [item.image for item in Inputs([pattern], None, ImageRecipe(), out)]
    assert found == [str(tmp_path / name) for name in photos]


def test_no_photo_is_its_own_mask(tmp_path: Path) -> None:
    for name in ("cup.png", "cup_mask.png"):
        (tmp_path / name).write_bytes(b"x")
    (item,) = Inputs([str(tmp_path)], f"{tmp_path}/", ImageRecipe())
    assert (PurePath(item.image).name, PurePath(item.mask).name) == ("cup.png", "cup_mask.png")
    (tmp_path / "cup_mask.png").unlink()
    with pytest.raises(InputError, match="has no mask for cup.png"):
        Inputs([str(tmp_path)], str(tmp_path), ImageRecipe())
