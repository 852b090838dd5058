"""The data set's card:

`README.md`, what somebody needs who finds the folder without the program that made it.
"""

import shlex
from typing import Any

_CARD = """# Rendered glossy objects with ground truth

{count} scenes of one object each, {size} x {size} pixels, {samples} light paths a pixel, made by

    {command}

The same command makes the same scenes; in this folder it goes on where it was interrupted.

| split | scenes | held out of train |
|---|---|---|
{splits}

Objects, materials and lights are members of families ("lathe03"). Every fifth member is held out, in every run alike. The `train` scenes
show none of these; each `test_*` split shows held-out members in its own aspect only, `test` in all three.

## Files of a scene

`SPLIT/OBJECT_MATERIAL_LIGHT_SEED/` holds

| file | channels | what |
|---|---|---|
| `maps.exr` | `image`, `diffuse`, `specular`, `residual`, `reflectance`, `shading`: `.R .G .B` | linear Rec.709; 1 is the full scale |
| | `normal.X .Y .Z` | unit vectors, x right, y up, z toward the viewer |
| | `height.Z` | pixels toward the viewer |
| | `mask.A`, `confidence.Y` | 1 on the object |
| `material.exr` | `strength.Y`, `gloss.Y` | of the gloss, in the convention that `scene.json` names |
| `variance.exr` | `diffuse`, `specular`, `shading`: `.R .G .B` | of the Monte Carlo estimates (of the mean, not of one sample) |
| `environment.exr` | `R`, `G`, `B` | all lights from the origin: latitude-longitude, row 0 straight up, first column away from the viewer |
| `photo.png` | RGBA | what a camera would store: sRGB codes, the mask as alpha |
| `preview.png` | RGB | to look at |
| `scene.json` | | seed, object, material with its convention, lights, camera matrices (OpenCV and Blender), units, versions, checksums |

All maps are (height, width) float32 of the whole frame, row 0 at the top; outside the mask they are 0 and the normal is (0, 0, 1).

Inside the mask `image = diffuse + specular + residual` and `diffuse = reflectance * shading`. The residual is what clipping, noise and
codes did to the image: {sensor}. Place and normal come from one ray through each pixel's centre.
Light that goes from one part of the object to another is {interreflection}. Rendered shading is not exp(SH(normal)): `illumination` in
`scene.json` is the light of that form that fits it best, `light_fit_residual` says how well.

`manifest.json` lists all scenes, their seeds and splits, and the settings.

## Licence

The scenes are yours: what the generator renders is not covered by the generator's licence (GPL-3.0-or-later), and nothing in it stands
in the way of giving them away under CC0.{derived}
"""
_HELD_OUT = {
    "train": "-",
    "test_objects": "objects",
    "test_materials": "materials",
    "test_lights": "lights",
    "test": "all three",
}
_LISTS = ("shapes", "materials", "albedos", "lights", "splits")
_NUMBERS = ("seed", "size", "samples", "bounces", "exposure", "renderer")
_FILES = {
    "mesh": "--mesh",
    "height": "--height",
    "albedo_image": "--albedo-image",
    "natural_lights": "--natural-lights",
    "hdr": "--hdr",
}


def card(settings: dict[str, Any], count: int, splits: dict[str, int]) -> str:
    """The text. `settings`: as in the manifest. `splits`: how many scenes each has."""
    rows = "\n".join(
        f"| {name} | {number} | {_HELD_OUT[name]} |" for name, number in splits.items()
    )
    own = [name.replace("_", " ") for name in _FILES if settings[name]]
    derived = (
        f"\nScenes that show or are lit by files of others ({', '.join(own)}) are derived from them: their terms apply too"
        if own
        else ""
    )
    if settings["natural_lights"]:
        derived += "; natural_lights.mat is research data"
    return _CARD.format(
        count=count,
        size=settings["size"],
        samples=settings["samples"],
        command=command(settings, count),
        splits=rows,
        sensor=_sensor(settings["sensor"]),
        interreflection=f"followed for {settings['bounces']} bounces"
        if settings["bounces"]
        else "left out",
        derived=f"{derived}." if derived else "",
    )


def command(settings: dict[str, Any], count: int) -> str:
    """What makes the same scenes again; files and the folder stand there by name only."""
    sensor = settings["sensor"]
    words = ["isc", "synth", "--count", str(count)]
    for name in _NUMBERS:
        words += [f"--{name}", str(settings[name])] if settings[name] is not None else []
    for name in _LISTS:
        words += [f"--{name}", ",".join(settings[name])] if settings[name] else []
    for name, option in _FILES.items():
        if settings[name]:
            words += [
                option,
                "ROOT"
                if name == "natural_lights"
                else "FILES"
                if name == "hdr"
                else settings[name]["file"],
            ]
    words += ["--perspective"] if settings["perspective"] else []
    words += ["--clip"] if sensor["clip"] else []
    words += ["--noise", str(sensor["noise"])] if sensor["noise"] else []
    words += ["--bits", str(sensor["bits"])] if sensor["bits"] else []
    return shlex.join([*words, "-o", "DIR"])


def _sensor(sensor: dict[str, Any]) -> str:
    done = ["clipped at 1"] if sensor["clip"] else []
    done += [f"noise of {sensor['noise']:g} at full scale"] if sensor["noise"] else []
    done += [f"{sensor['bits']}-bit sRGB codes"] if sensor["bits"] else []
    return ", ".join(done) or "nothing here, so it is 0"
