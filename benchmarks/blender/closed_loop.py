"""The closed loop: does what stands in Blender look like the photo, and does it stay right under
another light?

  python -m benchmarks.blender.closed_loop -o FOLDER --photos ../shared/data/photos          five photos and
  three rendered objects python -m benchmarks.blender.closed_loop -o FOLDER
  the rendered objects alone python -m benchmarks.blender.closed_loop -o FOLDER --names gourd --size 64
  --samples 16    a quick look

Each object is decomposed, built in Blender by the add-on's own `scene.build`, and rendered with
Cycles from the scene's camera, linear, view transform Standard. Judged inside the mask; peak: the
99.9th percentile of the photo there.

Equations: relative RMS = sqrt(sum (k W - S)^2 / sum S^2), W the render in white matt, S the
shading, k that of the base colour; PSNR = 10 log10(peak^2 / mean square). Under a new light the
render may take one gain g = <x, t> / <x, x>, as the scale between reflectance and light cannot be
known from one photo; g is the same for all colours, and the peak is the truth's. An object made of
the true maps has no such freedom.

Writes tables.md, rows.json and sheets of pictures to FOLDER; renders are kept in FOLDER/renders and
not made again (--fresh: they are).
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

from blender_addon.files.result_arrays import Result, read_result
from isc_core.errors import InputError
from isc_core.evaluation.metrics import psnr
from isc_core.result_files.contact_sheet import Shown, edit_sheet
from isc_core.shading.environment_map import shading_under

from .closed_loop_cases import PHOTOS, RENDERED, Case, Making, Relit, cases
from .renders import Look, picture

USUAL_FILTER = 1.5  # Blender's, pixels
_RING = 2  # pixels of the outline that "inner" leaves out
_SHEET_WIDTH, _SHEET_ROWS = 1000, 3


@dataclass(frozen=True)
class LoopRow:
    """One object in its own light.

    Relative RMS: `shading`, without its outline (`inner`), with the object's own shadows
    (`shadowed`), of the sky without any geometry (`sky`). PSNR in dB of the diffuse render:
    `diffuse`, `diffuse_inner`, `diffuse_shadowed`, and by Blender's usual pixel filter
    (`diffuse_usual`). PSNR of whole images against the photo: renders `matt`, `lobe`, `image` (with
    the specular image), and, for comparison, of the maps diffuse + lobe (`maps_lobe`).
    """

    name: str
    shading: float
    inner: float
    shadowed: float
    sky: float
    diffuse: float
    diffuse_inner: float
    diffuse_shadowed: float
    diffuse_usual: float
    matt: float
    lobe: float
    image: float
    maps_lobe: float


@dataclass(frozen=True)
class RelitRow:
    """One object in a new light.

    PSNR in dB against the true picture: the `photo` as it is, the matt object without and with its
    own shadows (`matt`, `shadowed`), with the lobe and shadows (`lobe`). Of diffuse light alone:
    the imported object (`diffuse`), and an object made of the true maps (`true_maps`), which is
    what the way through Blender costs. `gain`: g of `shadowed`.
    """

    name: str
    light: str
    photo: float
    matt: float
    shadowed: float
    lobe: float
    diffuse: float
    true_maps: float
    gain: float


@dataclass
class Renders:
    """The pictures of one result, made when asked for and kept in `path`."""

    result: Result
    path: Path
    samples: int
    kept: dict[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.path.is_file():
            with np.load(self.path, allow_pickle=False) as stored:
                self.kept = {name: stored[name] for name in stored.files}

    def __call__(self, look: Look) -> np.ndarray:
        """(H, W, 3) linear."""
        light = look.relit.light if look.relit is not None else "own"
        name = f"{light} {look.gloss} white={look.white} shadows={look.own_shadows} filter={look.filter_width} {self.samples}"
        if name not in self.kept:
            self.kept[name] = picture(self.result, look, self.samples)[0].astype(np.float32)
            self.path.parent.mkdir(parents=True, exist_ok=True)
            np.savez(self.path, **self.kept)
        return self.kept[name]


def loop_row(name: str, renders: Renders) -> LoopRow:
    """Measures an object in its own light."""
    r = renders.result
    mask, inner, peak, k = r.mask, _inner(r.mask), white(r.image, r.mask), r.reflectance_scale
    sky = np.zeros_like(r.shading)
    sky[mask] = k * shading_under(r.sky.astype(float), r.normal[mask].astype(float))
    own, shadowed = k * renders(Look(white=True)), k * renders(Look(white=True, own_shadows=True))
    matt = renders(Look())
    return LoopRow(
        name=name,
        shading=relative_rms(own, r.shading, mask),
        inner=relative_rms(own, r.shading, inner),
        shadowed=relative_rms(shadowed, r.shading, mask),
        sky=relative_rms(sky, r.shading, mask),
        diffuse=psnr(r.diffuse, matt, mask, peak=peak),
        diffuse_inner=psnr(r.diffuse, matt, inner, peak=peak),
        diffuse_shadowed=psnr(r.diffuse, renders(Look(own_shadows=True)), mask, peak=peak),
        diffuse_usual=psnr(r.diffuse, renders(Look(filter_width=USUAL_FILTER)), mask, peak=peak),
        matt=psnr(r.image, matt, mask, peak=peak),
        lobe=psnr(r.image, renders(Look("lobe")), mask, peak=peak),
        image=psnr(r.image, renders(Look("image")), mask, peak=peak),
        maps_lobe=psnr(r.image, r.diffuse + r.lobe, mask, peak=peak),
    )


def relit_row(name: str, new: Relit, renders: Renders, ideal: Renders) -> RelitRow:
    """Measures an object in a new light. `ideal`: of the true maps; both on the truth's grid."""
    mask = renders.result.mask & ideal.result.mask
    shadowed = renders(Look(own_shadows=True, relit=new))
    judged = {
        "photo": renders.result.image,
        "matt": renders(Look(own_shadows=False, relit=new)),
        "shadowed": shadowed,
        "lobe": renders(Look("lobe", own_shadows=True, relit=new)),
    }
    figures = {what: scaled_psnr(new.image, seen, mask) for what, seen in judged.items()}
    perfect = ideal(Look(own_shadows=True, relit=new)) / ideal.result.reflectance_scale
    diffuse, true_maps = (
        scaled_psnr(new.diffuse, shadowed, mask),
        psnr(new.diffuse, perfect, mask, peak=white(new.diffuse, mask)),
    )
    return RelitRow(
        name,
        new.light,
        **figures,
        diffuse=diffuse,
        true_maps=true_maps,
        gain=gain(new.image, shadowed, mask),
    )


def white(image: np.ndarray, mask: np.ndarray) -> float:
    """The peak of PSNR: the 99.9th percentile of the values (H, W, 3) inside the mask."""
    return float(np.percentile(image[mask], 99.9))


def relative_rms(seen: np.ndarray, wanted: np.ndarray, mask: np.ndarray) -> float:
    """RMS of the difference of (H, W, 3) over the RMS of `wanted`, inside the mask."""
    return float(
        np.sqrt(np.square(seen[mask] - wanted[mask]).mean() / np.square(wanted[mask]).mean())
    )


def gain(truth: np.ndarray, seen: np.ndarray, mask: np.ndarray) -> float:
    """The factor of `seen` that leaves the least squares."""
    inside = seen[mask].astype(float)
    return float((inside * truth[mask]).sum() / max(float(np.square(inside).sum()), 1e-30))


def scaled_psnr(truth: np.ndarray, seen: np.ndarray, mask: np.ndarray) -> float:
    """PSNR of `seen` after the best gain, peak the truth's white."""
    return psnr(truth, gain(truth, seen, mask) * seen, mask, peak=white(truth, mask))


def _inner(mask: np.ndarray) -> np.ndarray:
    eroded: np.ndarray = ndimage.binary_erosion(mask, iterations=_RING)
    return eroded if eroded.any() else mask


def loop_table(rows: Sequence[LoopRow]) -> str:
    """Markdown."""
    lines = [
        "| object | (i) white render against shading | without the outline | own shadows on | sky alone | (ii) diffuse "
        "| without the outline | own shadows on | usual filter | (iii) fitted lobe | no gloss | specular image | maps: diffuse + lobe |",
        "|---" * 13 + "|",
    ]
    for r in rows:
        shares = [f"{100 * value:.1f} %" for value in (r.shading, r.inner, r.shadowed, r.sky)]
        ratios = (
            r.diffuse,
            r.diffuse_inner,
            r.diffuse_shadowed,
            r.diffuse_usual,
            r.lobe,
            r.matt,
            r.image,
            r.maps_lobe,
        )
        lines.append(
            f"| {r.name} | " + " | ".join(shares + [f"{value:.1f} dB" for value in ratios]) + " |"
        )
    return "\n".join(lines) + "\n"


def relit_table(rows: Sequence[RelitRow]) -> str:
    """Markdown."""
    lines = [
        "| object | new light | photo as it is | matt, no shadows | matt, own shadows | lobe, own shadows | diffuse light alone "
        "| true maps, diffuse light | gain |",
        "|---" * 9 + "|",
    ]
    for r in rows:
        ratios = (r.photo, r.matt, r.shadowed, r.lobe, r.diffuse, r.true_maps)
        lines.append(
            f"| {r.name} | {r.light} | "
            + " | ".join(f"{value:.1f} dB" for value in ratios)
            + f" | {r.gain:.2f} |"
        )
    return "\n".join(lines) + "\n"


def loop_panels(name: str, renders: Renders) -> list[Shown]:
    """Photo, its diffuse layer, the renders of both, and the shading beside the white render."""
    r, peak = renders.result, white(renders.result.image, renders.result.mask)
    level = white(r.shading, r.mask)
    shown = (
        (r.image / peak, f"{name}: photo"),
        (renders(Look("image")) / peak, "Blender, specular image"),
        (renders(Look("lobe")) / peak, "Blender, fitted lobe"),
        (r.diffuse / peak, "Diffuse map"),
        (renders(Look()) / peak, "Blender, matt"),
        (r.shading / level, "Shading map"),
        (r.reflectance_scale * renders(Look(white=True)) / level, "Blender, white"),
    )
    return [Shown(values, r.mask, label) for values, label in shown]


def relit_panels(name: str, new: Relit, renders: Renders, ideal: Renders) -> list[Shown]:
    """The photo, the truth in the new light, and what Blender makes of the recovered and of the
    true maps.
    """
    mask, peak = ideal.result.mask, white(new.image, ideal.result.mask)
    matt, glossy = (
        renders(Look(own_shadows=True, relit=new)),
        renders(Look("lobe", own_shadows=True, relit=new)),
    )
    perfect = ideal(Look(own_shadows=True, relit=new)) / ideal.result.reflectance_scale
    shown = [(renders.result.image, f"{name}: photo"), (new.image, f"Truth, new {new.light}")]
    shown += [
        (gain(new.image, seen, mask) * seen, f"Blender, {label}")
        for seen, label in ((matt, "matt"), (glossy, "lobe"))
    ]
    shown += [(new.diffuse, "Truth, diffuse"), (perfect, "Blender, true maps")]
    return [Shown(values / peak, mask, label) for values, label in shown]


def save_sheet(
    path: Path, title: str, subtitle: str, panels: Sequence[Shown], columns: int
) -> None:
    """Writes a sheet small enough for a page."""
    sheet = edit_sheet(title, subtitle, panels, columns=columns)
    sheet = sheet.resize(
        (_SHEET_WIDTH, round(sheet.height * _SHEET_WIDTH / sheet.width)), Image.Resampling.LANCZOS
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(path, optimize=True)


def measure(given: argparse.Namespace) -> None:
    """Does everything that the command line asks for; tables and sheets are rewritten after each
    object.
    """
    making = Making(given.output, given.photos, given.size, max(16, 4 * given.samples))
    loops: list[LoopRow] = []
    relits: list[RelitRow] = []
    panels: dict[str, list[Shown]] = {"rendered": [], "photos": [], "relit": []}
    for case in cases(making, given.names or (RENDERED + (PHOTOS if given.photos else ()))):
        renders = _renders(given, case.name, case.result)
        loops.append(loop_row(case.name, renders))
        panels["photos" if case.truth is None else "rendered"] += loop_panels(case.name, renders)
        relits += _relit(given, case, renders, panels["relit"])
        _write(given, loops, relits, panels)
        print(loop_table(loops[-1:]).splitlines()[-1], flush=True)


def _renders(given: argparse.Namespace, name: str, result: Path) -> Renders:
    path = given.output / "renders" / f"{name}_{given.size}.npz"
    if given.fresh:
        path.unlink(missing_ok=True)
    return Renders(read_result(result), path, given.samples)


def _relit(
    given: argparse.Namespace, case: Case, renders: Renders, panels: list[Shown]
) -> list[RelitRow]:
    rows = []
    if case.truth is not None:
        ideal = _renders(given, f"{case.name}_true", case.truth)
        for new in case.relit:
            rows.append(relit_row(case.name, new, renders, ideal))
            panels += relit_panels(case.name, new, renders, ideal)
    return rows


def _write(
    given: argparse.Namespace,
    loops: list[LoopRow],
    relits: list[RelitRow],
    panels: dict[str, list[Shown]],
) -> None:
    (given.output / "tables.md").write_text(
        loop_table(loops) + "\n" + relit_table(relits), encoding="utf-8"
    )
    rows = {"loop": [asdict(row) for row in loops], "relit": [asdict(row) for row in relits]}
    (given.output / "rows.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    about = f"Cycles, {given.samples} samples, {given.size} px"
    for what, shown in panels.items():
        columns = 6 if what == "relit" else 7
        for page, first in enumerate(range(0, len(shown), _SHEET_ROWS * columns), start=1):
            path = given.output / f"closed_loop_{what}_{page}.png"
            save_sheet(
                path, _TITLES[what], about, shown[first : first + _SHEET_ROWS * columns], columns
            )


_TITLES = {
    "rendered": "The closed loop: rendered objects",
    "photos": "The closed loop: photos",
    "relit": "In a new light, against the truth",
}


def main(arguments: list[str] | None = None) -> int:
    """The command. Returns 0, or 2 after one line about what was wrong."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.blender.closed_loop",
        description="Render imported results and hold them to the photo.",
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, help="folder for everything that is made"
    )
    parser.add_argument("--photos", type=Path, help="folder with the real photos")
    parser.add_argument("--names", nargs="+", help=f"of {', '.join(RENDERED + PHOTOS)}")
    parser.add_argument(
        "--size",
        type=int,
        default=256,
        help="long side of the objects in pixels (default: %(default)s)",
    )
    parser.add_argument(
        "--samples", type=int, default=64, help="of Cycles, a pixel (default: %(default)s)"
    )
    parser.add_argument("--fresh", action="store_true", help="render anew what is there")
    try:
        measure(parser.parse_args(arguments))
    except InputError as error:
        print(f"closed loop: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
