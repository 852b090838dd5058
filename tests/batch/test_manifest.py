"""Manifests are read as streams, and errors in them name the line."""

import json
from pathlib import Path

import pytest

from isc_core.batch.item import BatchItem, ImageRecipe
from isc_core.batch.manifest import Manifest
from isc_core.decomposition.settings import Settings
from isc_core.errors import InputError


def items(path: Path, text: str | bytes) -> list[BatchItem]:
    """Of a manifest with this content."""
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return list(Manifest(str(path), ImageRecipe()))


def test_both_formats_give_the_same_items(tmp_path: Path) -> None:
    table = items(
        tmp_path / "a.csv",
        "image,mask,name,max-size,full_size,options\ncup.png,m/cup.png,tasse,128,yes,\n"
        '/x/jug.png,,,,,"{""seed"": 3}"\n\ns3://b/k.png,,,,,\n',
    )
    lines = items(
        tmp_path / "a.jsonl",
        '{"image": "cup.png", "mask": "m/cup.png", "name": "tasse", "options": {"max_size": 128, '
        '"full_size": true}}\n'
        '\n{"image": "/x/jug.png", "seed": 3}\n{"image": "s3://b/k.png", "mask": null}\n',
    )
    assert table == lines
    assert table[0] == BatchItem(
        f"{tmp_path}/cup.png",
        f"{tmp_path}/m/cup.png",
        "tasse",
        (("full_size", True), ("max_size", 128)),
        f"{tmp_path}/cup.png",
    )
    assert [item.image for item in table[1:]] == ["/x/jug.png", "s3://b/k.png"]
    assert table[1].options == (("seed", 3),)


def test_names_of_files_may_be_any_bytes(tmp_path: Path) -> None:
    assert (
        items(tmp_path / "a.csv", b"\xef\xbb\xbfimage\ncaf\xe9.png\n")[0]
        .image.encode("utf-8", "surrogateescape")
        .endswith(b"caf\xe9.png")
    )


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("a.csv", "", "no column `image`"),
        ("a.csv", "cup.png\n", "no column `image`"),
        ("a.csv", "image,size\nx,1\n", "unknown column 'size'"),
        ("a.csv", "image,image\nx,1\n", "is repeated"),
        ("a.csv", "image,mask\nx\n", "line 2 has 1 cells, the header 2"),
        ("a.csv", 'image\n"x\n', "is not CSV"),
        ("a.csv", "image,max_size\nx,-3\n", "line 2: max_size cannot be '-3'"),
        ("a.csv", "image,model\nx,nosuch\n", 'line 2: unknown model "nosuch"'),
        ("a.csv", "image,name\nx,../y\n", "line 2: '../y' is not a valid result name"),
        ("a.csv", "image\n" + "x" * (1 << 20) + "\n", "line 2 is longer"),
        ("a.jsonl", "{\n", "line 1 is not JSON"),
        ("a.jsonl", '{"image": "x"}\n[1]\n', "line 2 is not an object"),
        ("a.jsonl", "[" * 100_000 + "\n", "line 1 is not JSON"),
        ("a.jsonl", '{"mask": "x"}\n', "line 1 names no image"),
        ("a.jsonl", '{"image": 3}\n', "must be text"),
        ("a.jsonl", '{"image": "x", "name": "/tmp/y"}\n', "is not a valid result name"),
        ("a.jsonl", '{"image": "x", "options": [1]}\n', "options must be an object"),
        ("a.jsonl", '{"image": "x", "options": []}\n', "options must be an object"),
        ("a.jsonl", '{"image": "x", "options": 0}\n', "options must be an object"),
        ("a.jsonl", '{"image": "x", "options": {"threads": 3}}\n', "unknown option 'threads'"),
        ("a.jsonl", '{"image": "x", "full_size": 3}\n', "true or false"),
        ("a.jsonl", '{"image": "x", "seed": ' + "9" * 5000 + "}\n", "is not JSON"),
    ],
)
def test_a_mistake_is_one_line_with_its_position(
    tmp_path: Path, name: str, text: str, complaint: str
) -> None:
    with pytest.raises(InputError) as caught:
        items(tmp_path / name, text)
    assert complaint in str(caught.value)
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_manifest_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        list(Manifest(str(tmp_path / "none.csv"), ImageRecipe()))


def test_a_manifest_that_changes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    path.write_text('{"image": "x"}\n')
    manifest = Manifest(str(path), ImageRecipe())
    assert len(list(manifest)) == 1
    path.write_text(json.dumps({"image": "other"}) + "\n")
    with pytest.raises(InputError, match="changed"):
        list(manifest)


def test_a_manifest_is_not_loaded_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    path.write_text('{"image": "x"}\nthis line is wrong\n')
    stream = iter(Manifest(str(path), ImageRecipe()))
    assert next(stream).image == f"{tmp_path}/x"
    with pytest.raises(InputError, match="line 2"):
        next(stream)


def test_the_size_of_a_line_replaces_the_full_size_of_the_run() -> None:
    recipe = ImageRecipe(Settings(full_size=True))
    assert recipe.changed(()).settings.maps_size == 0
    assert recipe.changed((("max_size", 256),)).settings.maps_size == 256
    assert recipe.changed((("full_size", True), ("max_size", 256))).settings.maps_size == 0
