"""The cards of a glossy set, `README.md`: descriptions for readers without this program."""

import shlex

from ..templating import render
from .settings import GlossySettings


def card(name: str, level: float, light: str, settings: GlossySettings) -> str:
    """Write the README of one set.

    Parameters
    ----------
    name : str
        Its folder, relative to the output.
    level : float
        Specular share of the light, per cent.
    light : str
        One of `settings.LIGHTS`.
    settings : GlossySettings
        The settings of the run.

    Returns
    -------
    str
        Markdown.

    Raises
    ------
    InputError
        If Jinja2 is not installed.
    """
    own_light, _, panel = light.partition("-")
    return render(
        __file__,
        "README.md.j2",
        name=name,
        folder=name.rpartition("/")[2],
        command=command(settings),
        own_light=own_light,
        panel=bool(panel),
        physical=name.startswith("physical/"),
        level=level,
        exponent=settings.exponent,
    )


def index(settings: GlossySettings, roots: tuple[str, ...]) -> str:
    """Write the README of the whole output.

    Parameters
    ----------
    settings : GlossySettings
        The settings of the run.
    roots : tuple of str
        Folders of the data sets.

    Returns
    -------
    str
        Markdown.
    """
    return render(__file__, "index.md.j2", command=command(settings), roots=roots)


def command(settings: GlossySettings) -> str:
    """Return the command that makes the same files.

    Parameters
    ----------
    settings : GlossySettings
        Settings of the set.

    Returns
    -------
    str
        A shell command; folders are given by name only: "ROOT" and "DIR".
    """
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
