"""Which Blenders a zip is for: one platform and one version of Python each."""

import platform
import sys
from dataclasses import dataclass

from isc_core.errors import InputError

# Wheels for macOS are made for 13 and later, as OpenCV's are; those for Linux need glibc 2.28, as
# Blender does.
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
    """`platform`: as Blender names it.

    `python`: (major, minor). `blender_min` <= Blender < `blender_max` (empty: no end).
    """

    platform: str
    python: tuple[int, int]
    blender_min: str
    blender_max: str = ""

    @property
    def name(self) -> str:
        """What the zip's name ends in, such as linux-x64-cp311."""
        return f"{self.platform}-{self.abi}"

    @property
    def abi(self) -> str:
        """The interpreter as wheels name it, such as cp311."""
        return f"cp{self.python[0]}{self.python[1]}"

    @property
    def pip_platforms(self) -> tuple[str, ...]:
        """The platforms whose wheels run here, the most modern first."""
        return _PIP_PLATFORMS[self.platform]

    def runs(self, wheel: str) -> bool:
        """Whether the wheel of this file name is for this target."""
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
    """(3, 7) of cp37."""
    digits = tag.removeprefix("cp")
    return int(digits[0]), int(digits[1:])


_PLATFORMS = ("linux-x64", "windows-x64", "macos-arm64")

# Blender 4.5 and 5.0 run Python 3.11, blender.org's later ones 3.13; a distribution's Blender runs
# that distribution's Python.
TARGETS = (
    *(Target(name, (3, 11), "4.5.0", "5.1.0") for name in _PLATFORMS),
    *(Target(name, (3, 13), "5.1.0") for name in _PLATFORMS),
    Target("linux-x64", (3, 14), "5.1.0"),
)


def chosen(name: str) -> tuple[Target, ...]:
    """The targets called `name`: one's name, "all", or "here" for the machine and Python that this
    runs on. Raises `InputError`.
    """
    if name == "all":
        return TARGETS
    wanted = _here() if name == "here" else name
    found = tuple(target for target in TARGETS if target.name == wanted)
    if not found:
        raise InputError(
            f"no extension is built for {wanted}: choose all, here, {', '.join(target.name for target in TARGETS)}"
        )
    return found


def _here() -> str:
    machine = _HERE.get(
        (platform.system(), platform.machine()), f"{platform.system()} {platform.machine()}"
    )
    return f"{machine}-cp{sys.version_info[0]}{sys.version_info[1]}"
