"""The command that installs a missing optional dependency.

Problem: the distribution is on no package index, so pip cannot install its extras by name. The
metadata of the installed distribution, whether from a wheel or a clone, list the requirements of
each extra. The command names these packages themselves.

Limits: environment markers of a requirement (version of Python, platform) are ignored: pip reports
a package that has no build for this Python.
"""

import re
import shlex

_DISTRIBUTION = "isc3d"


def install_command(extra: str) -> str:
    """Return the command that installs the requirements of an extra.

    Parameters
    ----------
    extra : str
        Name of an extra of this distribution, such as "batch".

    Returns
    -------
    str
        A shell command with the requirements of the extra. Without metadata (a clone that is not
        installed, an add-on inside Blender): the command to run in the source folder.
    """
    requirements = _requirements(extra) or [f".[{extra}]"]
    return shlex.join(["pip", "install", *requirements])


def _requirements(extra: str) -> list[str]:
    # Slow to import, and used only for error messages.
    from importlib.metadata import PackageNotFoundError, requires

    try:
        listed = requires(_DISTRIBUTION) or []
    except PackageNotFoundError:
        return []
    split = (text.partition(";") for text in listed)
    return [
        requirement.strip()
        for requirement, _, marker in split
        if re.search(rf"""\bextra\s*==\s*["']{re.escape(extra)}["']""", marker)
    ]
