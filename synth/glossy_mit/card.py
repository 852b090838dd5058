"""The cards of a glossy set: what somebody needs who finds the folder without the program that made
it.
"""

import shlex

from .settings import GlossySettings

_CARD = """# {name}: MIT-Berkeley objects under a gloss

Made by

    {command}

from the MIT-Berkeley intrinsic images (R. Grosse, M. K. Johnson, E. H. Adelson, W. T. Freeman 2009, doi:10.1109/ICCV.2009.5459428;
J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712). **Derived from research data under its own terms: not to be redistributed.**

Light: {light}.
Specular: {level:g} % of the light inside the mask (the sum over its pixels and channels).

`isc evaluate {last} --dataset mit-berkeley --input original` (or `--input diffuse`) reads this folder.
The files, their frame and crop are the set's; all pictures are linear, 16 bits a channel, 1/65535 a code, 0 outside the mask.

| file in `laboratory/OBJECT/` | what |
|---|---|
| `original.png` | diffuse + specular, exactly, in codes; highlights clip at 65535 where `clipped_share` is above 0 |
| `diffuse.png` | reflectance x shading; at least one code inside the mask |
| `specular.png` | the gloss, in codes, as far as the original holds it |
| `specular.exr` | the gloss, not clipped: float32 channels R, G, B of the same scale |
| `reflectance.png` | the set's own |
| `shading_corrected_color.mat` | `shading_correct` (rows, columns, 3); `shading.png`: its mean over the channels |
| `mask.png`, `depth_valid.png` | the set's mask where the reflectance is above 0 and all heights around a pixel are known |
| `Z.mat` | `depth` (rows, columns): height toward the viewer in pixels, the set's own, NaN outside the mask |
| `L.mat` | `color_lights.diffuse` (9, 3): {coefficients}, in the set's convention |
| `crop_idx.mat` | the evaluation crop, the set's own file |
| `object.json` | measured shares, gain, strength of the gloss, residuals, panel, checksums |

`natural/OBJECT/` holds `original.png`, `diffuse.png`, `shading_color.png` and `L.mat` of the SAME light, under the names of the set's
natural half: what reads that half finds this object too, with that half's expectations of lights.

Shading is {shading}.
The gloss is a normalised Blinn-Phong lobe of exponent {exponent:g} under a non-negative environment fitted to exp(SH(normal)){panel}
(`environment_fit_residual`: RMS of what the fit leaves, over the RMS of that shading).
{shadows}
All levels of an object under one light share one gain, so that they differ in the specular layer only. `scene.json` holds the settings,
the versions and every object's record.
"""
_INDEX = """# MIT-Berkeley objects under a gloss

Made by

    {command}

**Derived from research data under its own terms: not to be redistributed.** Each folder is a data set of its own, with a README:

{roots}
"""


def card(name: str, level: float, light: str, settings: GlossySettings) -> str:
    """The README of one root, `name` below the output's folder."""
    own, _, extra = light.partition("-")
    physical = name.startswith("physical/")
    exact = not (physical or extra)
    shading = "exp(SH(normal)) with the set's own coefficients and the normals of its heights"
    if physical:
        shading = "rendered by Mitsuba under that environment, with the object's own shadows, and kept at albedo 1"
    elif extra:
        shading += ", and the panel's"
    return _CARD.format(
        name=name,
        last=name.rpartition("/")[2],
        command=command(settings),
        light=f"the object's own {own} light of the set"
        + (", and one white panel (softbox), in both layers" if extra else ""),
        level=level,
        coefficients="the set's own light, with the gain"
        if exact
        else "the light that fits best (`light_fit_residual`)",
        shading=shading,
        exponent=settings.exponent,
        panel=" and the panel" if extra else "",
        shadows="Shadows are cast by the heights; light between parts of the object is left out. The gloss has the grain of its samples "
        "(`gloss_noise`)."
        if physical
        else "Shadows and light between parts of the object are left out of both layers.",
    )


def index(settings: GlossySettings, roots: tuple[str, ...]) -> str:
    """The README of the whole output."""
    return _INDEX.format(
        command=command(settings), roots="\n".join(f"- `{name}`" for name in roots)
    )


def command(settings: GlossySettings) -> str:
    """What makes the same files again; folders stand there by name only."""
    words = [
        "isc",
        "synth",
        "glossy-mit",
        "ROOT",
        "-o",
        "DIR",
        "--levels",
        ",".join(f"{level:g}" for level in settings.levels),
    ]
    words += [
        "--samples",
        str(settings.samples),
        "--seed",
        str(settings.seed),
        "--exponent",
        f"{settings.exponent:g}",
    ]
    return shlex.join(words + (["--physical"] if settings.physical else []))
