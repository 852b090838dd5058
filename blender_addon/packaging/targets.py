"""The targets of zips: one platform and one Python version each."""

import platform
import sys
from dataclasses import dataclass

from isc_core.errors import InputError

# On Linux, wheels require glibc 2.28, as Blender.
_PIP_PLATFORMS = {
    "linux-x64": (
        "manylinux_2_28_x86_64",
        "manylinux_2_27_x86_64",
        "manylinux_2_17_x86_64",
        "manylinux2014_x86_64",
    ),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_13_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64"),
}
_HERE = {
    ("Linux", "x86_64"): "linux-x64",
    ("Windows", "AMD64"): "windows-x64",
    ("Darwin", "arm64"): "macos-arm64",
}


@dataclass(frozen=True)
class Target:
    """Platform, Python and Blender versions of one zip.

    Attributes
    ----------
    platform : str
        Name of the platform in Blender's manifests.
    python : tuple of int
        Major and minor version.
    blender_min : str
        First supported version of Blender.
    blender_max : str
        First unsupported version of Blender, "" for none.
    """

    platform: str
    python: tuple[int, int]
    blender_min: str
    blender_max: str = ""

    @property
    def name(self) -> str:
        """Name of the target, for example linux-x64-cp311."""
        return f"{self.platform}-{self.abi}"

    @property
    def abi(self) -> str:
        """Tag of the interpreter in wheel names, for example cp311."""
        return f"cp{self.python[0]}{self.python[1]}"

    @property
    def pip_platforms(self) -> tuple[str, ...]:
        """Tags of compatible platforms in wheel names, the newest first."""
        return _PIP_PLATFORMS[self.platform]

    def runs(self, wheel: str) -> bool:
        """Return whether a wheel is compatible.

        Parameters
        ----------
        wheel : str
            File name of a wheel.

        Returns
        -------
        bool
            Whether Python, ABI and platform in its name fit the target.
        """
        python, abi, platforms = wheel.removesuffix(".whl").split("-")[-3:]
        fits_python = (
            python == "py3"
            or python == abi == self.abi
            or (abi == "abi3" and _version(python) <= self.python)
        )
        return fits_python and (
            platforms == "any" or not set(platforms.split(".")).isdisjoint(self.pip_platforms)
        )


def _version(tag: str) -> tuple[int, int]:
    """For example (3, 7) for cp37."""
    digits = tag.removeprefix("cp")
    return int(digits[0]), int(digits[1:])


# Blender 4.5 and 5.0 include Python 3.11, later builds of blender.org 3.13. The Blender of a Linux
# distribution uses the distribution's Python.
TARGETS = (
    *(Target(name, (3, 11), "4.5.0", "5.1.0") for name in _PIP_PLATFORMS),
    *(Target(name, (3, 13), "5.1.0") for name in _PIP_PLATFORMS),
    Target("linux-x64", (3, 14), "5.1.0"),
)


def chosen(name: str) -> tuple[Target, ...]:
    """Return the targets of a name.

    Parameters
    ----------
    name : str
        Name of a target, "all", or "here" for this machine and Python.

    Returns
    -------
    tuple of Target
        At least one target.

    Raises
    ------
    InputError
        If there is none.
    """
    if name == "all":
        return TARGETS
    wanted = _here() if name == "here" else name
    found = tuple(target for target in TARGETS if target.name == wanted)
    if not found:
        raise InputError(
            f"no extension is built for {wanted}: "
            f"choose all, here, {', '.join(target.name for target in TARGETS)}"
        )
    return found


def _here() -> str:
    machine = _HERE.get(
        (platform.system(), platform.machine()), f"{platform.system()} {platform.machine()}"
    )
    return f"{machine}-cp{sys.version_info[0]}{sys.version_info[1]}"
