"""Laws of every separation method and variant.

Equations, inside the mask: image = diffuse + specular + residual; 0 <= diffuse <= image; specular
>= 0; residual = 0 but where clipped.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from isc_core.decomposition import Separation
from isc_core.separation import METHODS, separate, variants

from .law import Law, Notes, between, finite, threads
from .pictures import Picture, ordinary, pictures

# What would take its time also on a small photo.
SHORTER: dict[str, dict[str, object]] = {"akashi_2016": {"iterations": 40, "starts": 1}}
EVERY = tuple((method, variant) for method in METHODS for variant in variants(method))
OURS = tuple((method, "improved") for method in METHODS)
MOVES: dict[str, Callable[[np.ndarray], np.ndarray]] = {"flip": np.fliplr, "turn": np.rot90}
_LAYERS = ("diffuse", "specular", "residual", "confidence")


@dataclass(frozen=True)
class Task:
    """A picture, and what separates it."""

    picture: Picture
    method: str
    variant: str

    def split(
        self, image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None
    ) -> Separation:
        """The separation of another image in this task's place."""
        return separate(
            self.method,
            image,
            mask,
            clipped,
            variant=self.variant,
            changes=SHORTER.get(self.method),
        )


def tasks(
    drawn: st.SearchStrategy[Picture], methods: tuple[tuple[str, str], ...]
) -> st.SearchStrategy[Task]:
    """Pictures with one of the (method, variant) pairs."""
    return st.builds(lambda picture, pair: Task(picture, *pair), drawn, st.sampled_from(methods))


def sound(
    split: Separation, image: np.ndarray, mask: np.ndarray, clipped: np.ndarray | None = None
) -> None:
    """Asserts the identities of a separation of `image` (H, W, 3) inside `mask` (H, W)."""
    peak = max(float(image[mask].max()), 1e-30)
    finite(
        diffuse=split.diffuse,
        specular=split.specular,
        residual=split.residual,
        confidence=split.confidence,
    )
    for name in _LAYERS:
        layer = getattr(split, name)
        assert layer.dtype == np.float32 and layer.shape[:2] == mask.shape, name
        assert not layer[~mask].any(), f"{name} outside the mask"
    total = split.diffuse.astype(float) + split.specular + split.residual
    assert np.abs(total - image)[mask].max() <= 1e-5 * peak, "the layers do not add up"
    assert (split.diffuse >= 0).all() and (
        split.diffuse[mask] <= image[mask] + 1e-6 * peak
    ).all(), "diffuse leaves [0, image]"
    assert (split.specular >= 0).all(), "negative specular light"
    between(0, 1, confidence=split.confidence)
    explained = mask if clipped is None else mask & ~clipped
    assert np.abs(split.residual[explained]).max(initial=0) <= 1e-6 * peak, (
        "a residual that is not explained"
    )


def _sound(task: Task, notes: Notes) -> None:
    del notes
    p = task.picture
    image, mask = p.light(), p.inside()
    clipped = p.clipped() if p.clips else None
    before = image.copy()
    sound(task.split(image, mask, clipped), image, mask, clipped)
    assert np.array_equal(image, before), "the input was changed"


def _threads(task: Task, notes: Notes) -> None:
    del notes
    image, mask = task.picture.light(), task.picture.inside()
    with threads(1):
        one = task.split(image, mask)
    with threads(2):
        two = task.split(image, mask)
    for name in _LAYERS:
        assert np.array_equal(getattr(one, name), getattr(two, name)), (
            f"{name} depends on the number of threads"
        )


def _padding(task: Task, notes: Notes) -> None:
    p = task.picture
    image, mask = p.light(), p.inside()
    plain = task.split(image, mask)
    sides = [(p.seed % 5, 3), (2, p.seed % 7)]
    wide = task.split(np.pad(image, [*sides, (0, 0)], constant_values=0.7), np.pad(mask, sides))
    inner = np.s_[sides[0][0] : sides[0][0] + p.rows, sides[1][0] : sides[1][0] + p.columns]
    peak = max(float(image[mask].max()), 1e-30)
    change = np.abs(wide.diffuse[inner] - plain.diffuse).max() / peak
    assert notes.measure(f"padding {task.method}", change) <= 1e-5, (
        f"padding changes the diffuse layer by {change:.2g} of the peak"
    )


def _turned(task: Task, notes: Notes) -> None:
    """How much of the photo's light goes to the other layer, in the mean over the pixels, as a
    share of the mean light.
    """
    image, mask = task.picture.light(), task.picture.inside()
    plain = task.split(image, mask).diffuse
    mean = float(image[mask].mean())
    for name, move in MOVES.items():
        other = task.split(
            np.ascontiguousarray(move(image)), np.ascontiguousarray(move(mask))
        ).diffuse
        change = float(np.abs(other - move(plain))[move(mask)].mean()) / mean
        bound = TURN_BOUNDS.get(task.method, 0.0)
        assert notes.measure(f"{name} {task.method}", change) <= bound, (
            f"{name}: {change:.2g} of the mean light changes its layer"
        )


def _scale(task: Task, notes: Notes) -> None:
    image, mask = task.picture.light(), task.picture.inside()
    plain = task.split(image, mask).diffuse
    for name, factor in (("x 2", 2.0), ("x 3.7", 3.7), ("x .01", 0.01)):
        other = task.split((np.float32(factor) * image).astype(np.float32), mask).diffuse / factor
        change = float(np.abs(other - plain)[mask].mean()) / float(image[mask].mean())
        bound = SCALE_BOUNDS.get(task.method, 1e-6)
        assert notes.measure(f"{name} {task.method}", change) <= bound, (
            f"{name}: {change:.2g} of the mean light changes its layer"
        )


# Of the mean light, what may change its layer: measured over many ordinary photos
# (docs/properties.md), with room to spare.
TURN_BOUNDS: dict[str, float] = dict.fromkeys(METHODS, 0.05) | {"network": 0.2}
SCALE_BOUNDS: dict[str, float] = dict.fromkeys(METHODS, 0.01)

LAWS = (
    Law(
        "separation sound",
        "any picture, mask, method and variant: finite layers that add up, within the image",
        tasks(pictures(), EVERY),
        _sound,
        0.03,
    ),
    Law(
        "separation threads", "the same bytes on one thread and on two",
        tasks(pictures(8, 40), OURS), _threads, 0.06),
    Law(
        "separation padding", "what is around the object's box does not matter",
        tasks(pictures(4, 36), OURS), _padding, 0.06),
    Law(
        "separation turned", "flips and 90-degree rotations, to a bound",
        tasks(ordinary(), OURS), _turned, 0.1),
    Law(
        "separation scale", "the image times a constant, to a bound",
        tasks(ordinary(), OURS), _scale, 0.12),
)  # fmt: skip
