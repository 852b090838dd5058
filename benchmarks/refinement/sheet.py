"""A sheet of objects before and after the refinement of their gloss.

  python -m benchmarks.refinement.sheet RESULT ... -o SHEET.jpg [--side N]

Each is a result folder of `isc decompose`, or the start of a scene of `gloss_scenes`. A row has the
photo, and then pairs, the start and the refined result: the diffuse layer with the lobe from the
photo's view, the mesh turned by 30 degrees, and under a lamp from the other side, drawn as in
preview.png. Results with nothing to refine, or whose start stays, are named and left out.
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from isc_core.errors import InputError
from isc_core.imaging.srgb import linear_to_srgb
from isc_core.io.atomic import new_file
from isc_core.refinement import refine_gloss
from isc_core.refinement.gloss_note import gloss_line
from isc_core.result_files.other_views import relit_panel, turned_panels
from isc_core.result_files.panels import Frame, Panel, exposure
from isc_core.result_files.result_folder import load
from isc_core.scene.decomposition import Decomposition

_SIDE, _QUALITY = 72, 68
_EDGE = ((1, 1), (1, 1), (0, 0))  # of each picture, black
_MAPS = ("image", "diffuse", "specular", "reflectance", "shading", "normal", "height")


def row_of(start: Decomposition, refined: Decomposition, side: int) -> np.ndarray:
    """Draw the row of a result.

    Parameters
    ----------
    start, refined : Decomposition
    side : int
        Of a picture, pixels.

    Returns
    -------
    (side + 2, ..., 3) uint8 ndarray
        Seven pictures.
    """
    frame, gain = Frame.around(start.mask), exposure(start.image[start.mask])
    pictures = [Panel(gain * frame.scaled(start.image), frame.coverage, "")]
    views = [_views(d, frame, gain) for d in (start, refined)]
    pictures += [panel for pair in zip(*views, strict=True) for panel in pair]
    return np.hstack([np.pad(_codes(one, side), _EDGE) for one in pictures])


def _views(d: Decomposition, frame: Frame, gain: float) -> tuple[Panel, Panel, Panel]:
    """From the photo's view, turned, and in another light."""
    small = {name: frame.scaled(getattr(d, name)) for name in _MAPS}
    seen = Panel(gain * (small["diffuse"] + frame.scaled(d.lobe)), frame.coverage, "")
    return seen, turned_panels(d, frame, small, gain)[0], relit_panel(d, frame, small)


def _codes(panel: Panel, side: int) -> np.ndarray:
    light = np.clip(panel.color, 0, 1) * panel.coverage[..., None]
    codes = np.rint(255 * linear_to_srgb(light)).astype(np.uint8)
    return np.asarray(Image.fromarray(codes).resize((side, side), Image.Resampling.LANCZOS))


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="objects before and after isc refine")
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE")
    parser.add_argument("--side", type=int, default=_SIDE, help="pixels (default: %(default)s)")
    given = parser.parse_args()
    rows = []
    try:
        for folder in given.results:
            start = load(folder)
            done = refine_gloss(start)
            print(f"{folder}: {gloss_line(done.result.provenance.settings)}", flush=True)
            if done.kept:
                rows.append(row_of(start, done.result, given.side))
        if not rows:
            raise InputError("no gloss was refined: give other results")
        picture = Image.fromarray(np.vstack(rows))
        with new_file(given.output) as partial:
            picture.save(partial, "JPEG", quality=_QUALITY, optimize=True, progressive=True)
    except InputError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
