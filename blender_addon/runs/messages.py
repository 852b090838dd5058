"""The sentences that the window shows.

The worker's messages name files and command-line options in British spelling; the window names
images and fields of the panels, in Blender's own.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import bpy

REPORT = "ISC Report"
NOTE = "note: "  # begins notes that advise something
_FIELDS = {
    "--light-colour": "Light Color",
    "--texture-size": "Texture Size",
    "--max-size": "Size",
    "--illumination": "Light",
    "--camera": "Camera",
    "--transfer": "Color Space",
    "--threads": "Threads",
    "--separator": "Separator",
    "--model": "Model",
    "--box": "Box",
    "--highlight-odds": "Remove Highlights",
    "--highlight": "Highlights",
    "--not-highlight": "Print",
    "--point": "Points",
    "--not": "Background",
    "--each": "Each Object",
}
# Advice that names these is about masks, and the panel offers other ways.
_MASK_OPTION, _MASK_COMMAND = re.compile(r"--mask(?![\w-])"), "isc mask"
_PART = re.compile(r"^object (\d+) of (\d+): ")
_REPORTED_BY = re.compile(r"^(Error: |Operator bpy\.ops\.\S+\.poll\(\) )")
_MAX_SECONDS = 90  # more are shown in minutes
_MASK_ADVICE = "choose a mask image, or make one with Add Point or Select Box"
_ADVICE = {  # what a command line does otherwise
    "use --light-colour estimate": "set Light Color to Estimate",
    "use --light-colour R,G,B": "set Light Color to Custom",
    "or --camera MM": "or set Camera to Perspective",
    "or require lower odds": "or set Remove Highlights to Likely",
    "leave out --transfer": "set Color Space to sRGB",
    "put --point on it, or --box around it": _MASK_ADVICE,
}
# A message that begins otherwise begins with the name of something.
_FIRST_WORDS = frozenset(
    {"a", "an", "cannot", "exported", "gloss", "hardly", "highlights", "internal", "it", "no"}
    | {"nothing", "several", "the", "there", "undetermined", "unknown"}
    | {"expected", "much"}
)
_SPELLING = {"colour": "color", "Colour": "Color", "grey": "gray"}


def translate_message(message: str, names: Mapping[str, str]) -> str:
    """Rewrite a message of the command line for the window.

    Parameters
    ----------
    message : str
        "What is wrong: what to do".
    names : mapping of str to str
        Name of the image of each file path.

    Returns
    -------
    str
        The message with image names and field labels.
    """
    known = sorted(names.items(), key=lambda item: -len(item[0]))
    for number, (path, _) in enumerate(known):  # names keep their spelling
        message = message.replace(path, f"\0{number}\0")
    for words, others in _ADVICE.items():
        message = message.replace(words, others)
    problem, colon, advice = message.rpartition(": ")
    if colon and (_MASK_OPTION.search(advice) or _MASK_COMMAND in advice):
        several = ", or enable Each Object" if "--each" in advice else ""
        message = f"{problem}: {_MASK_ADVICE}{several}"
    for option, field in _FIELDS.items():
        message = re.sub(rf"{option}(?![\w-])=?", field, message)
    for british, american in _SPELLING.items():
        message = message.replace(british, american)
    for number, (_, name) in enumerate(known):
        message = message.replace(f"\0{number}\0", name)
    return message


def sentence(message: str) -> str:
    """Return a message as Blender writes its own: with a capital, unless it begins with a name.

    Parameters
    ----------
    message : str
        A message.

    Returns
    -------
    str
    """
    first = message.partition(" ")[0].rstrip(":,")
    return message[0].upper() + message[1:] if first in _FIRST_WORDS else message


def error_line(error: RuntimeError) -> str:
    """Return what an operator that was called from Python has reported.

    Parameters
    ----------
    error : RuntimeError
        As Blender raises it.

    Returns
    -------
    str
        Its first line, without "Error: " and the name of the operator.
    """
    return _REPORTED_BY.sub("", str(error).strip().splitlines()[0])


def reason_line(error: Exception) -> str:
    """Return why an exporter, a renderer or the system failed, from a text of several lines.

    Parameters
    ----------
    error : Exception
        As Blender or Python raises it.

    Returns
    -------
    str
        Its last line: those before say where.
    """
    return str(error).strip().splitlines()[-1]


def is_about_mask(message: str) -> bool:
    """Return whether a message advises to make a mask.

    Parameters
    ----------
    message : str
        A message of the window.

    Returns
    -------
    bool
    """
    return _MASK_ADVICE in message


def join_notes(lines: Iterable[str]) -> str:
    """Join notes on a result into one line.

    Parameters
    ----------
    lines : iterable of str
        The notes; empty ones are left out.

    Returns
    -------
    str
        The notes, separated by semicolons.
    """
    return "; ".join(filter(None, (line.strip() for line in lines)))


def notes_of_objects(notes: Mapping[str, Sequence[str]]) -> list[str]:
    """Merge the notes on the objects of a photo.

    Parameters
    ----------
    notes : mapping of str to sequence of str
        Notes by the number of the object.

    Returns
    -------
    list of str
        Notes on all objects once, the others with the number of their object.
    """
    found = []
    for note in dict.fromkeys(note for lines in notes.values() for note in lines):
        about = [number for number, lines in notes.items() if note in lines]
        if len(about) == len(notes):
            found.append(note)
            continue
        start = NOTE if note.startswith(NOTE) else ""
        word = "object" if len(about) == 1 else "objects"
        found.append(f"{start}{word} {', '.join(about)}: {note.removeprefix(start)}")
    return found


def busy_message(title: str) -> str:
    """Return why nothing can start while the run of that title is active.

    Parameters
    ----------
    title : str
        Title of the active run.

    Returns
    -------
    str
        "What is wrong: what to do".
    """
    return f"{title} is running: wait for it, or cancel it first"


def progress_message(title: str, stage: str, fraction: float) -> str:
    """Return the text of the status bar during a run.

    Parameters
    ----------
    title : str
        Title of the run.
    stage : str
        Present stage.
    fraction : float
        Completed fraction of the work in [0, 1].

    Returns
    -------
    str
        Title, stage and percentage, and that Esc cancels.
    """
    return f"{title}: {stage} ({100 * fraction:.0f} %), Esc to cancel"


def stage_text(stage: str, seconds_left: float | None) -> str:
    """Return the name of a stage with the time that is left.

    Parameters
    ----------
    stage : str
        The stage.
    seconds_left : float or None
        Estimate of the time until the end of the run; None if unknown.

    Returns
    -------
    str
        For example "shape and light, about 20 s left"; "object 2 of 3: " is "2/3: ", because a
        panel is narrow.
    """
    stage = _PART.sub(r"\1/\2: ", stage)
    if seconds_left is None:
        return stage
    if seconds_left < _MAX_SECONDS:
        return f"{stage}, about {max(5 * round(seconds_left / 5), 5)} s left"
    return f"{stage}, about {round(seconds_left / 60)} min left"


def write_report(title: str, message: str, log: str) -> Any:
    """Write an error into the text datablock "ISC Report", for the text editor.

    Parameters
    ----------
    title : str
        Name of the run.
    message : str
        The error.
    log : str
        Last part of the worker's log.

    Returns
    -------
    bpy.types.Text
        The datablock.
    """
    text = bpy.data.texts.get(REPORT) or bpy.data.texts.new(REPORT)
    text.clear()
    text.write(f"{title}\n{message}\n\n{log.strip()}\n")
    return text
