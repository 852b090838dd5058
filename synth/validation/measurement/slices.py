"""Groups of scenes that are reported separately: by gloss, light, albedo, material, mask size and
share of specular light.

Limits: slices of different kinds overlap, so a difference between two slices may be caused by a
third property.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...dataset.reading import SceneFacts

EVERYTHING = "all"
_SHARES = (0.02, 0.1, 0.25)


@dataclass(frozen=True)
class Slice:
    """A group of scenes.

    Attributes
    ----------
    kind : str
        The property, "all" for all scenes.
    value : str
        Its value, as the report shows it.
    members : tuple of int
        Indices of scenes, ascending.
    """

    kind: str
    value: str
    members: tuple[int, ...]


def all_slices(facts: Sequence[SceneFacts]) -> tuple[Slice, ...]:
    """Group scenes by every property that differs between them.

    Parameters
    ----------
    facts : sequence of SceneFacts
        The scenes.

    Returns
    -------
    tuple of Slice
        All scenes first, then the slices of each kind.
    """
    sizes = [float(scene.mask_pixels) for scene in facts]
    limits = tuple(float(limit) for limit in np.quantile(sizes, [1 / 3, 2 / 3])) if sizes else ()
    kinds: tuple[tuple[str, Callable[[SceneFacts], str]], ...] = (
        ("gloss", lambda scene: scene.gloss_class),
        ("light", lambda scene: scene.light_kind),
        ("albedo", lambda scene: scene.albedo),
        ("material", lambda scene: scene.model),
        (
            "specular share",
            lambda scene: _between(
                scene.specular_share, _SHARES, lambda limit: f"{100 * limit:g} %"
            ),
        ),
        (
            "mask size",
            lambda scene: _between(scene.mask_pixels, limits, lambda limit: f"{limit:.0f} px"),
        ),
        ("split", lambda scene: scene.split),
    )
    found = [Slice(EVERYTHING, EVERYTHING, tuple(range(len(facts))))]
    for kind, of in kinds:
        values = [of(scene) for scene in facts]
        if len(set(values)) > 1:
            groups = [
                Slice(kind, value, tuple(k for k, own in enumerate(values) if own == value))
                for value in sorted(set(values))
            ]
            found += sorted(groups, key=lambda group: _order(kind, group, facts))
    return tuple(found)


def _order(kind: str, group: Slice, facts: Sequence[SceneFacts]) -> tuple[float, str]:
    """Numeric slices in ascending order, named ones alphabetically."""
    smallest = facts[group.members[0]]
    rank = {
        "specular share": smallest.specular_share,
        "mask size": float(smallest.mask_pixels),
    }.get(kind, 0.0)
    return rank, group.value


def _between(value: float, limits: Sequence[float], text: Callable[[float], str]) -> str:
    above = [limit for limit in limits if value >= limit]
    below = [limit for limit in limits if value < limit]
    if not above:
        return f"below {text(below[0])}" if below else EVERYTHING
    return f"{text(above[-1])} to {text(below[0])}" if below else f"from {text(above[-1])}"
