"""Photos as cameras write them, from the command line: notes, records, edits in their own space."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from isc_core.cli.main import main
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.io.decoders.colour.space import ColourSpace
from isc_core.io.decoders.png import write_png
from isc_core.io.decoders.raster import raster_of_codes
from isc_core.photo import read_linear
from isc_core.result_files.reading_notes_text import stored_note_lines
from tests.core.lit_balls import under_lights
from tests.core.photo.icc_profiles import P3, SRGB_CURVE, encoded, parametric_curve, to_d50
from tests.core.photo.icc_profiles import rgb_profile as profile_of

P3_PROFILE = profile_of(to_d50(P3), parametric_curve(*SRGB_CURVE), "Display P3", 4)


def ball() -> np.ndarray:
    """Codes in Display P3, on black."""
    return encoded(0.6 * under_lights((0.4, -0.5, 0.8))[0], to_d50(P3), None, 255)


def test_a_broken_profile_is_one_note(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Image.fromarray(ball()).save(tmp_path / "a.png", icc_profile=b"broken" * 50)
    arguments = ["separate", str(tmp_path / "a.png"), "--method", "none", "-o"]
    assert main([*arguments, str(tmp_path / "out")]) == 0
    printed = "".join(capsys.readouterr())
    assert printed.count("colour profile is damaged or does not fit its pixels: sRGB") == 1


@pytest.mark.slow
def test_a_phones_photo_is_decomposed_and_edited_in_its_own_space(tmp_path: Path) -> None:
    pillow_heif = pytest.importorskip("pillow_heif", reason="needs the extra heic")
    heic, png = tmp_path / "a.heic", tmp_path / "a.png"
    image = pillow_heif.from_pillow(Image.fromarray(ball()))
    image.save(heic, quality=95, icc_profile=P3_PROFILE)
    write_png(png, raster_of_codes(ball(), 255, space=ColourSpace("", profile=P3_PROFILE)))
    for photo in (heic, png):
        result, edited = tmp_path / f"{photo.name}.result", tmp_path / f"{photo.name}.edited"
        arguments = ["decompose", str(photo), "--model", "retinex", "--max-size", "64", "-o"]
        assert main([*arguments, str(result)]) == 0
        record = json.loads((result / "decomposition.json").read_text())["input"]
        assert (record["colour_profile"], record["transfer"]) == ("Display P3", "srgb")
        assert record["reading_notes"] == [] and record["bit_depth"] == 8
        arguments = ["edit", str(result), "gloss", "--look", "metallic", "--photo", str(photo)]
        assert main([*arguments, "-o", str(edited)]) == 0
        picture, light = read_linear(edited / "edited.png"), read_linear(edited / "edited.exr")
        with Image.open(io.BytesIO((edited / "edited.png").read_bytes())) as written:
            assert written.info["icc_profile"] == P3_PROFILE
        shown, true = (linear_to_srgb(np.clip(values, 0, 1)) for values in (picture, light))
        assert 255 * np.abs(shown - true).max() < 3


def test_foreign_records_of_notes_are_read_or_ignored() -> None:
    assert stored_note_lines(None) == stored_note_lines([1, {"kind": "new"}, {}]) == []
    (line,) = stored_note_lines([{"kind": "out of gamut", "value": 0.25}])
    assert line.startswith("note: ") and "25%" in line
    (line,) = stored_note_lines([{"kind": "gain map", "value": "x"}])
    assert "gain map" in line
