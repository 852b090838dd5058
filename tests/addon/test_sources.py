"""The inputs of the command line: photos, results, masks; and its output files."""

from pathlib import Path

import pytest

from blender_addon.headless_sources import Source, find_sources, output_files
from isc_core.errors import InputError


def touch(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"")
    return path


def result(folder: Path) -> Path:
    touch(folder / "decomposition.json")
    touch(folder / "preview.png")
    return folder


def test_a_folder_gives_its_photos_and_results_in_order_and_takes_masks_beside_them(
    tmp_path: Path,
) -> None:
    names = ("b.png", "b_mask.png", "a.JPG", "notes.txt", ".hidden.png", "d.HEIC", "e.cr2")
    for name in names:
        touch(tmp_path / name)
    result(tmp_path / "c")
    touch(tmp_path / "empty" / "x.png")  # folders in folders are not searched
    assert find_sources([tmp_path], None) == [
        Source(tmp_path / "a.JPG", "a"),
        Source(tmp_path / "b.png", "b", mask=tmp_path / "b_mask.png"),
        Source(tmp_path / "c", "c", is_result=True),
        Source(tmp_path / "d.HEIC", "d"),
        Source(tmp_path / "e.cr2", "e"),
    ]


def test_a_result_is_known_by_its_description(tmp_path: Path) -> None:
    assert find_sources([result(tmp_path / "cup")], None) == [
        Source(tmp_path / "cup", "cup", is_result=True)
    ]


def test_masks_come_from_a_file_or_a_folder(tmp_path: Path) -> None:
    a, b = touch(tmp_path / "a.png"), touch(tmp_path / "b.jpg")
    one = touch(tmp_path / "white.png")
    assert find_sources([a], one)[0].mask == one
    assert find_sources([a, result(tmp_path / "r")], one)[1].mask is None
    masks = [touch(tmp_path / "masks" / "a.png"), touch(tmp_path / "masks" / "b_mask.png")]
    assert [source.mask for source in find_sources([a, b], tmp_path / "masks")] == masks
    masks[1].unlink()
    with pytest.raises(InputError, match=r"contains no mask for b.jpg: name it b.png"):
        find_sources([a, b], tmp_path / "masks")
    with pytest.raises(InputError, match="is one file for 2 photos: give a folder of masks"):
        find_sources([a, b], one)
    with pytest.raises(InputError, match="no such mask"):
        find_sources([a], tmp_path / "none.png")


def test_names_differ_on_case_insensitive_file_systems(tmp_path: Path) -> None:
    paths = [
        touch(tmp_path / "x" / "Cup.png"),
        touch(tmp_path / "y" / "cup.jpg"),
        touch(tmp_path / "cup.tif"),
    ]
    assert [source.name for source in find_sources(paths, None)] == ["Cup", "cup-2", "cup-3"]


def test_missing_and_empty_inputs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.png: no such photo or folder"):
        find_sources([tmp_path / "none.png"], None)
    with pytest.raises(InputError, match="contains no photo .* and no result"):
        find_sources([tmp_path], None)


def test_output_files() -> None:
    one, two = (
        [Source(Path("a.png"), "a")],
        [Source(Path("a.png"), "a"), Source(Path("b.png"), "b")],
    )
    blend = (".blend",)
    assert output_files(two, None, blend, "-o", together=True) == [None, None]
    assert output_files(one, Path("o.blend"), blend, "-o", together=True) == [Path("o.blend")]
    assert output_files(two, Path("o.blend"), blend, "-o", together=True) == [Path("o.blend")] * 2
    assert output_files(two, Path("o"), blend, "-o", together=True) == [
        Path("o/a.blend"),
        Path("o/b.blend"),
    ]
    assert output_files(one, Path("o.EXR"), (".png", ".exr"), "--render", together=False) == [
        Path("o.EXR")
    ]
    with pytest.raises(InputError, match="--render o.png is one file for 2 objects: give a folder"):
        output_files(two, Path("o.png"), (".png", ".exr"), "--render", together=False)


def test_an_unsupported_suffix_is_refused_unless_the_folder_exists(tmp_path: Path) -> None:
    one = [Source(Path("a.png"), "a")]
    for name in ("out.jpg", "out.txt", "v1.2"):
        with pytest.raises(
            InputError, match=r"--render .*: give a file that ends in .png or .exr, or a folder"
        ):
            output_files(one, tmp_path / name, (".png", ".exr"), "--render", together=False)
    (tmp_path / "v1.2").mkdir()
    assert output_files(one, tmp_path / "v1.2", (".png", ".exr"), "--render", together=False) == [
        tmp_path / "v1.2" / "a.png"
    ]
    touch(tmp_path / "out.txt")
    with pytest.raises(InputError, match=r"-o .*: give a file that ends in .blend, or a folder"):
        output_files(one, tmp_path / "out.txt", (".blend",), "-o", together=True)
