"""Properties of whole decompositions.

Shape and light are solved at a few pixels in a few steps: these tests exercise the paths through
the program, not the quality of its results.
"""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import strategies as st

from isc_core.decomposition.pipeline import MODELS, Settings, decompose
from isc_core.photo import Photo, check_mask
from isc_core.progress import Monitor, ProgressEvent
from isc_core.result_files.mesh.build import build_mesh
from isc_core.scene.decomposition import Decomposition
from isc_core.separation import METHODS
from tests.core.small_solves import small_solves
from tests.properties.laws import at_most, between, finite, law, threads
from tests.properties.photos import KINDS, MASKS, MadePhoto, ordinary, photos
from tests.properties.test_separation import MOVES, moved_light

LAYERS = ("image", "diffuse", "specular", "residual", "reflectance", "shading")
MAPS = (*LAYERS, "normal", "height", "confidence")
FAST_METHODS = tuple(m for m in METHODS if m not in ("akashi_2016", "sparse_coding"))
USUAL_KINDS = tuple(kind for kind in KINDS if kind not in ("constant", "black"))
USUAL_MASKS = tuple(mask for mask in MASKS if mask not in ("pixel", "row"))
# The measured maxima (docs/robustness.md) with a margin.
TURN_DEGREES, TURN_SHARE = 90.0, 0.05
SCALE_DEGREES, SCALE_SHARE = 90.0, 0.02


@dataclass(frozen=True)
class DecompositionCase:
    """A photo and how it is decomposed."""

    made: MadePhoto
    model: str
    separator: str = "isc"
    illumination: str = "natural"
    engine: str = "auto"


def cases(
    drawn: st.SearchStrategy[MadePhoto],
    models: tuple[str, ...] = MODELS,
    separators: tuple[str, ...] = FAST_METHODS,
) -> st.SearchStrategy[DecompositionCase]:
    """Photos with settings of every kind."""
    model, separator = st.sampled_from(models), st.sampled_from(separators)
    light = st.sampled_from(("natural", "laboratory"))
    engine = st.sampled_from(("auto", "auto", "auto", "numpy"))
    return st.builds(DecompositionCase, drawn, model, separator, light, engine)


def decomposed(
    case: DecompositionCase,
    photo: Photo | None = None,
    monitor: Monitor | None = None,
    count: int = 1,
) -> Decomposition:
    """Decompose on `count` threads; refuse what reading the photo would refuse."""
    photo = photo or case.made.photo()
    check_mask(photo.mask, "the mask")
    settings = Settings(
        case.model, case.separator, case.illumination, max_size=0, engine=case.engine, threads=count
    )
    with small_solves():
        return decompose(photo, settings, monitor=monitor)


class Listener:
    """Collects the fractions and losses that a decomposition reports."""

    def __init__(self) -> None:
        self.fractions: list[float] = []
        self.losses: list[float] = []
        self.monitor = Monitor(self._report)

    def _report(self, event: ProgressEvent) -> None:
        self.fractions.append(event.fraction)
        if found := re.search(r"loss (\S+)", event.detail):
            self.losses.append(float(found[1]))


def assert_sound(d: Decomposition) -> None:
    """Assert the identities of a decomposition and the ranges of its maps."""
    finite(**{name: getattr(d, name) for name in MAPS}, illumination=d.illumination)
    assert not d.identity_errors().broken(), d.identity_errors().broken()
    for name in (*LAYERS, "height", "confidence"):
        assert not getattr(d, name)[~d.mask].any(), f"{name} outside the mask"
    assert (d.normal[~d.mask] == [0, 0, 1]).all(), "normals outside the mask"
    assert (d.normal[..., 2] >= 0).all(), "a normal faces away"
    for name in ("diffuse", "specular", "reflectance", "height"):
        assert (getattr(d, name) >= 0).all(), f"negative {name}"
    assert (d.shading[d.mask] > 0).all(), "shading is not positive"
    between(0, 1, confidence=d.confidence)


@pytest.mark.slow
@law(cases(photos(7, 32, masks=(*USUAL_MASKS, *USUAL_MASKS, "row"))), seconds=0.4)
def test_maps_and_mesh_are_sound(case: DecompositionCase) -> None:
    listener = Listener()
    d = decomposed(case, monitor=listener.monitor)
    assert_sound(d)
    between(-1e-9, 1 + 1e-9, progress=np.array(listener.fractions))
    assert np.isfinite(listener.losses).all(), f"losses {listener.losses}"
    for number in ("loss", "iterations", "evaluations"):
        assert np.isfinite(getattr(d.provenance.diagnostics, number) or 0.0), number
    built = build_mesh(d.height, d.normal, d.mask, d.reflectance)
    finite(vertices=built.mesh.vertices, base=built.base_color, detail=built.detail)
    between(0, len(built.mesh.vertices) - 1, faces=built.mesh.faces)
    assert len(built.glb()) > 500


@law(cases(photos(10, 32, USUAL_KINDS, USUAL_MASKS), ("sirfs", "mdr"), ("isc",)), seconds=0.3)
def test_solver_accepts_no_larger_loss(case: DecompositionCase) -> None:
    """Up to the rounding of the reported losses."""
    listener = Listener()
    decomposed(case, monitor=listener.monitor)
    for before, after in zip(listener.losses[:-1], listener.losses[1:], strict=True):
        assert after <= before + 0.06 + 1e-3 * abs(before), f"loss rises: {before} to {after}"


@pytest.mark.slow
@law(cases(photos(12, 28, USUAL_KINDS, USUAL_MASKS)), seconds=0.7)
def test_number_of_threads_does_not_matter(case: DecompositionCase) -> None:
    with threads(1):
        one = decomposed(case)
    with threads(3):
        three = decomposed(case, count=3)
    for name in MAPS:
        assert np.array_equal(getattr(one, name), getattr(three, name)), name
    assert np.allclose(one.illumination, three.illumination, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
@law(cases(ordinary()), seconds=0.7)
def test_frame_around_the_object_does_not_matter(case: DecompositionCase) -> None:
    photo = case.made.photo()
    height, width = photo.mask.shape
    if photo.mask[[0, -1]].any() or photo.mask[:, [0, -1]].any():
        return  # the frame cuts the object; with a margin the object would end there
    sides = [(case.made.seed % 6 + 1, 3), (2, case.made.seed % 9 + 1)]
    wide = replace(
        photo,
        image=np.pad(photo.image, [*sides, (0, 0)]),
        mask=np.pad(photo.mask, sides),
        clipped=np.pad(photo.clipped, sides),
    )
    plain, padded = decomposed(case, photo), decomposed(case, wide)
    (top, _), (left, _) = sides
    for name in MAPS:
        inner = getattr(padded, name)[top : top + height, left : left + width]
        assert np.array_equal(getattr(plain, name), inner), name


def median_angle(a: np.ndarray, b: np.ndarray, mask: np.ndarray) -> float:
    """Median angle in degrees between two normal maps."""
    cosines = np.clip((a.astype(float) * b).sum(-1)[mask], -1, 1)
    return float(np.degrees(np.median(np.arccos(cosines))))


@pytest.mark.slow
@law(cases(ordinary()), seconds=1.0)
def test_flips_and_turns_change_little(case: DecompositionCase) -> None:
    """A flip negates x; a rotation to the left maps (x, y) to (-y, x)."""
    photo = case.made.photo()
    plain = decomposed(case, photo)
    for name, move in MOVES.items():
        fields = {key: getattr(photo, key) for key in ("image", "mask", "clipped")}
        moved = {key: np.ascontiguousarray(move(values)) for key, values in fields.items()}
        other = decomposed(case, replace(photo, **moved))
        n = move(plain.normal)
        turned = np.stack([-n[..., 1], n[..., 0], n[..., 2]], -1)
        angle = median_angle(n * [-1, 1, 1] if name == "flip" else turned, other.normal, other.mask)
        share = moved_light(move(plain.diffuse), other.diffuse, moved["image"], other.mask)
        at_most(TURN_DEGREES, angle, f"{name} {case.model}: degrees of the median normal")
        at_most(TURN_SHARE, share, f"{name} {case.model}: share of the light")


@pytest.mark.slow
@law(cases(ordinary()), seconds=1.0)
def test_exposure_changes_little(case: DecompositionCase) -> None:
    photo = case.made.photo()
    plain = decomposed(case, photo)
    for factor in (2.0, 3.7):
        image = (np.float32(factor) * photo.image).astype(np.float32)
        brighter = replace(photo, image=image, code_value=factor * photo.code_value)
        other = decomposed(case, brighter)
        share = moved_light(other.diffuse / factor, plain.diffuse, photo.image, plain.mask)
        angle = median_angle(plain.normal, other.normal, plain.mask)
        at_most(SCALE_SHARE, share, f"x {factor:g} {case.model}: share of the light")
        at_most(SCALE_DEGREES, angle, f"x {factor:g} {case.model}: degrees of the median normal")
