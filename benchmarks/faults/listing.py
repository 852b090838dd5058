"""Folders of very many images: how they are listed and named."""

import time
from pathlib import Path

from isc_core.batch.item import Recipe
from isc_core.batch.names import Names
from isc_core.batch.sources import Inputs

from .disk import fresh


def many_images(place: Path, count: int) -> tuple[list[str], str]:
    """Lists and names `count` images of one folder, hidden and other files among them: what was
    wrong, and how long it took.
    """
    fresh(place)
    for number in range(count):
        (place / f"image {number:06}.png").touch()
    for name in (".hidden.png", "letter.txt", "image 000003_mask.png"):
        (place / name).touch()
    start = time.monotonic()
    items = Inputs([str(place)], None, Recipe())
    names = Names(items)
    given = [names.name(item) for item in items]
    seconds = time.monotonic() - start
    wrong = (
        []
        if len(given) == len(set(given)) == count and None not in given
        else [f"WRONG: {len(set(given))} names of {len(given)}"]
    )
    masks = [item.mask for item in items if item.mask]
    return wrong or [
        "" if len(masks) == 1 else f"WRONG: masks {masks[:3]}"
    ], f"listed and named in {seconds:.2f} s"
