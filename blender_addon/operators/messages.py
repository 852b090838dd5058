"""What the worker says, in the words of the window: its messages name files and options, people see
images and fields.
"""

from collections.abc import Mapping
from typing import Any

import bpy

REPORT = "ISC Report"
_INSTEAD = (
    (
        "make a mask with `isc mask PHOTO --box x,y,w,h -o MASK` and give it with --mask",
        "choose a mask image, or cut one out of a box",
    ),
    ("give a mask of the photo's size", "give a mask of the photo's size, or tick Scale Mask"),
    ("--max-size ", "Size "),
    ("--illumination ", "Light "),
    ("--transfer ", "colour space "),
    ("--threads ", "Threads "),
    ("--separator ", "Separator "),
    ("--model ", "Model "),
    ("--box ", "Box "),
    ("--box:", "Box:"),
)
_FOR_TERMINALS = ("look at ",)


def in_words(message: str, names: Mapping[str, str]) -> str:
    """A message with the files in it called by `names` (path: name of the image) and options called
    as the panel calls them.
    """
    for path, name in sorted(names.items(), key=lambda item: -len(item[0])):
        message = message.replace(path, name)
    for option, field in _INSTEAD:
        message = message.replace(option, field)
    return message


def notes_of(message: str) -> str:
    """What a worker's last words say of the result, in one line: what only helps at a terminal is
    left out.
    """
    lines = (line.strip() for line in message.splitlines())
    return "; ".join(line for line in lines if line and not line.startswith(_FOR_TERMINALS))


def keep_report(title: str, message: str, report: str) -> Any:
    """Writes what went wrong into the text "ISC Report", for the text editor; returns the
    datablock.
    """
    text = bpy.data.texts.get(REPORT) or bpy.data.texts.new(REPORT)
    text.clear()
    text.write(f"{title}\n{message}\n\n{report.strip()}\n")
    return text
