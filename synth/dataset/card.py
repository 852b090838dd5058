"""The data set's card, `README.md`: a description for readers without this program."""

import shlex
from collections.abc import Mapping

from ..capture.recipe import Sources
from ..capture.sensor import Sensor
from ..templating import render
from .settings import DatasetSettings

_HELD_OUT = {
    "train": "-",
    "test_objects": "objects",
    "test_materials": "materials",
    "test_lights": "lights",
    "test": "all three",
}


def card(settings: DatasetSettings, splits: Mapping[str, int]) -> str:
    """Write the card.

    Parameters
    ----------
    settings : DatasetSettings
        The data set.
    splits : mapping of str to int
        Number of scenes of each split.

    Returns
    -------
    str
        Markdown.

    Raises
    ------
    InputError
        If Jinja2 is not installed.
    """
    return render(
        __file__,
        "README.md.j2",
        count=settings.count,
        picture=settings.picture,
        command=command(settings),
        splits=splits,
        held_out=_HELD_OUT,
        sensor=_sensor(settings.picture.sensor),
        own_files=[name.lstrip("-").replace("-", " ") for name, _ in _files(settings.sources)],
        natural_lights=settings.sources.natural_lights is not None,
    )


def command(settings: DatasetSettings) -> str:
    """Return the command that renders the same scenes.

    Parameters
    ----------
    settings : DatasetSettings
        Settings of the data set.

    Returns
    -------
    str
        A shell command; files are given by name only, and the output folder is "DIR".
    """
    choices, picture, sensor = settings.choices, settings.picture, settings.picture.sensor
    options: dict[str, object] = {
        "--count": settings.count,
        "--seed": settings.seed,
        "--size": picture.size,
        "--samples": picture.samples,
        "--bounces": picture.bounces,
        "--exposure": picture.exposure,
        "--renderer": picture.renderer,
        "--shapes": ",".join(choices.shapes) or None,
        "--materials": ",".join(choices.materials) or None,
        "--albedos": ",".join(choices.albedos) or None,
        "--lights": ",".join(choices.lights) or None,
        "--splits": ",".join(choices.splits) or None,
        **dict(_files(settings.sources)),
    }
    words = ["isc", "synth"]
    for name, value in options.items():
        words += [] if value is None else [name, str(value)]
    words += ["--perspective"] if picture.perspective else []
    words += ["--clip"] if sensor.clip else []
    words += ["--noise", str(sensor.noise)] if sensor.noise else []
    words += ["--bits", str(sensor.bits)] if sensor.bits else []
    return shlex.join([*words, "-o", "DIR"])


def _files(sources: Sources) -> list[tuple[str, str]]:
    """Options and names of the user's files."""
    files = (
        ("--mesh", sources.mesh),
        ("--height", sources.height),
        ("--albedo-image", sources.albedo_image),
    )
    found = [(option, path.name) for option, path in files if path is not None]
    found += [("--natural-lights", "ROOT")] if sources.natural_lights is not None else []
    return found + ([("--hdr", "FILES")] if sources.hdr else [])


def _sensor(sensor: Sensor) -> str:
    done = ["clipped at 1"] if sensor.clip else []
    done += [f"noise of {sensor.noise:g} at full scale"] if sensor.noise else []
    done += [f"{sensor.bits}-bit sRGB codes"] if sensor.bits else []
    return ", ".join(done) or "none here, so it is 0"
