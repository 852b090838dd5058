"""Where the results of the objects of one photo lie.

Programs that show results read it too, so that it needs no numerical library.
"""

from pathlib import Path

_RESULT = "decomposition.json"


def object_folders(folder: Path) -> list[Path]:
    """Return the results of the objects of a photo, from left to right.

    Parameters
    ----------
    folder : Path
        Folder that `isc decompose --each` has written.

    Returns
    -------
    list of Path
        Those of its folders 1, 2 and so on that are there.
    """
    found = (path.parent for path in folder.glob(f"*/{_RESULT}"))
    return sorted((one for one in found if one.name.isdecimal()), key=lambda one: int(one.name))
