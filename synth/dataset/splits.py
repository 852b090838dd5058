"""The pools of objects, materials and lights, their held-out members, and their combination by a
scene's seed.

Equation: of each family every fifth member (number mod 5 = 4) is held out; of materials every fifth
round through the albedos, number = round * albedos + albedo. A scene of "train" has only members
that are not held out; of "test_objects", "test_materials", "test_lights" one held-out member in
that aspect alone; of "test" three. The split depends on the scene's seed, so that a longer run
begins with the shorter one; the rule is the same for all runs, so that no run has training scenes
with members that another run holds out.

Citation: S. Kaufman et al., "Leakage in data mining: formulation, detection, and avoidance", ACM
Transactions on Knowledge Discovery from Data 6(4) (2012), doi:10.1145/2382577.2382579.

Limits: a user's own mesh, height map or image is one member and is never held out; HDR files are,
from the fifth on.
"""

from dataclasses import dataclass

import numpy as np

from isc_core.datasets.mit_berkeley import load_natural_lights
from isc_core.errors import InputError

from ..albedos import ALBEDOS
from ..capture.recipe import (
    HEIGHT_FILE,
    IMAGE_FILE,
    MESH_FILE,
    FamilyMember,
    PictureSettings,
    Recipe,
    Sources,
)
from ..light_rigs import FROM_FILES, RIGS
from ..scene.materials import DIFFUSE_MODELS, MODELS
from ..shapes import SHAPES

# A scene's split is the entry at its seed modulo ten.
_PATTERN = (
    "train",
    "train",
    "train",
    "test_objects",
    "train",
    "test_materials",
    "train",
    "test_lights",
    "train",
    "test",
)
_HELD_OUT = {
    "train": "",
    "test_objects": "shape",
    "test_materials": "material",
    "test_lights": "light",
    "test": "shape material light",
}
SPLITS = tuple(_HELD_OUT)
_EVERY = 5
_MEMBERS = 20  # of a family of objects or lights
_ROUNDS = 5  # of a material through the albedos
_GLOSSY_WEIGHT = 3  # of a glossy model relative to a diffuse one


@dataclass(frozen=True)
class Choices:
    """The families that scenes are drawn from, by name.

    Attributes
    ----------
    shapes, materials, albedos, lights : tuple of str
        "mesh", "height" and "image" are the user's files ("mesh" among the albedos: its own
        colours); materials are models.
    splits : tuple of str
        The splits; empty for all possible ones.

    Raises
    ------
    InputError
        For unknown or repeated names.
    """

    shapes: tuple[str, ...] = SHAPES
    materials: tuple[str, ...] = MODELS
    albedos: tuple[str, ...] = ALBEDOS
    lights: tuple[str, ...] = tuple(name for name in RIGS if name not in FROM_FILES)
    splits: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        known = {
            "shape": (self.shapes, (*SHAPES, MESH_FILE, HEIGHT_FILE)),
            "material": (self.materials, MODELS),
            "albedo": (self.albedos, (*ALBEDOS, IMAGE_FILE, MESH_FILE)),
            "light": (self.lights, RIGS),
            "split": (self.splits, SPLITS),
        }
        for kind, (names, all_names) in known.items():
            if unknown := [name for name in names if name not in all_names]:
                raise InputError(f"unknown {kind} {unknown[0]!r}: choose {', '.join(all_names)}")
            if len(set(names)) < len(names) or not (names or kind == "split"):
                raise InputError(f"give each {kind} once, and at least one")


@dataclass(frozen=True)
class _Member:
    """A family member with its fixed properties, and whether it is held out."""

    part: FamilyMember
    held_out: bool
    model: str = ""
    albedo: str = ""


@dataclass(frozen=True)
class Pools:
    """All members that a run draws from.

    Attributes
    ----------
    shape, material, light : tuple
        The members.
    pattern : tuple of str
        The splits that scenes cycle through, by seed.
    """

    shape: tuple[_Member, ...]
    material: tuple[_Member, ...]
    light: tuple[_Member, ...]
    pattern: tuple[str, ...]

    def split_of(self, seed: int) -> str:
        """Return the split of a seed's scene.

        Parameters
        ----------
        seed : int
            The scene's seed, >= 0.

        Returns
        -------
        str
            One of `pattern`.
        """
        return self.pattern[seed % len(self.pattern)]

    def recipe(self, seed: int, picture: PictureSettings, sources: Sources) -> Recipe:
        """Return the recipe of a seed's scene.

        Parameters
        ----------
        seed : int
            The seed.
        picture : PictureSettings
            Camera, renderer and sensor.
        sources : Sources
            The user's files.

        Returns
        -------
        Recipe
            The recipe.
        """
        rng = np.random.default_rng(np.random.SeedSequence(seed))
        held = _HELD_OUT[self.split_of(seed)].split()
        shape, material, light = (
            _drawn(getattr(self, kind), kind in held, rng)
            for kind in ("shape", "material", "light")
        )
        return Recipe(
            seed,
            shape.part,
            material.part,
            material.model,
            material.albedo,
            light.part,
            picture,
            sources,
        )


def make_pools(choices: Choices, sources: Sources) -> Pools:
    """Return the members of all chosen families.

    Parameters
    ----------
    choices : Choices
        The families.
    sources : Sources
        The user's files.

    Returns
    -------
    Pools
        The members.

    Raises
    ------
    InputError
        If a requested split has no held-out members, or a file is missing.
    """
    shapes = tuple(
        _Member(part, held)
        for name in choices.shapes
        for part, held in _members(name, _shapes_of(name, sources))
    )
    lights = tuple(
        _Member(part, held)
        for name in choices.lights
        for part, held in _members(name, _lights_of(name, sources))
    )
    for name, path, option in (
        (IMAGE_FILE, sources.albedo_image, "--albedo-image"),
        (MESH_FILE, sources.mesh, "--mesh"),
    ):
        if name in choices.albedos and path is None:
            raise InputError(f"the albedo {name!r} is read from a file: give {option} FILE")
    materials = tuple(
        member for model in choices.materials for member in _materials(model, choices.albedos)
    )
    pools = {"shape": shapes, "material": materials, "light": lights}
    lacking = {
        kind for kind, members in pools.items() if not any(member.held_out for member in members)
    }
    possible = [name for name in SPLITS if not lacking & set(_HELD_OUT[name].split())]
    if impossible := [name for name in choices.splits if name not in possible]:
        raise InputError(
            f"the split {impossible[0]} is not possible: the choice has no held-out members; "
            "choose more families, or omit the split"
        )
    wanted = choices.splits or tuple(possible)
    return Pools(shapes, materials, lights, tuple(name for name in _PATTERN if name in wanted))


def _members(family: str, many: int) -> list[tuple[FamilyMember, bool]]:
    return [(FamilyMember(family, number), number % _EVERY == _EVERY - 1) for number in range(many)]


def _shapes_of(name: str, sources: Sources) -> int:
    own = {MESH_FILE: sources.mesh, HEIGHT_FILE: sources.height}
    if name not in own:
        return _MEMBERS
    if own[name] is None:
        raise InputError(f"the shape {name!r} is read from a file: give --{name} FILE")
    return 1


def _lights_of(name: str, sources: Sources) -> int:
    if name not in FROM_FILES:
        return _MEMBERS
    if name == "natural" and sources.natural_lights is not None:
        return int(load_natural_lights(sources.natural_lights).shape[2])
    if name == "hdr" and sources.hdr:
        return len(sources.hdr)
    raise InputError(f"the light {name!r} is read from files: give {FROM_FILES[name]}")


def _materials(model: str, albedos: tuple[str, ...]) -> list[_Member]:
    found = []
    for albedo in albedos:
        own = albedo in (IMAGE_FILE, MESH_FILE)
        for turn in range(_ROUNDS):
            number = turn if own else turn * len(ALBEDOS) + ALBEDOS.index(albedo)
            found.append(
                _Member(
                    FamilyMember(f"{model}_{albedo}" if own else model, number),
                    turn % _EVERY == _EVERY - 1,
                    model,
                    albedo,
                )
            )
    return found


def _drawn(members: tuple[_Member, ...], held_out: bool, rng: np.random.Generator) -> _Member:
    """Draw a member: first the family, glossy ones more often than diffuse ones, then the
    member.
    """
    eligible = [member for member in members if member.held_out == held_out]
    families = sorted({member.model or member.part.family for member in eligible})
    weights = np.array([1.0 if name in DIFFUSE_MODELS else _GLOSSY_WEIGHT for name in families])
    family = families[int(rng.choice(len(families), p=weights / weights.sum()))]
    eligible = [member for member in eligible if (member.model or member.part.family) == family]
    return eligible[int(rng.integers(len(eligible)))]
