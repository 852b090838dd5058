"""The refinement of gloss: gradients, what it finds on a shape that is wrong, where it abstains."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isc_core.errors import Cancelled, InputError
from isc_core.progress import Monitor
from isc_core.refinement import GlossOptions, refine_gloss
from isc_core.refinement.gloss_note import GlossOutcome, gloss_line
from isc_core.refinement.gloss_objective import Gloss, GlossData, GlossObjective, height_slopes
from isc_core.refinement.height_bumps import HeightBumps
from isc_core.refinement.working_scale import working_scale
from isc_core.result_files.result_folder import load, save
from isc_core.scene.decomposition import Decomposition, Provenance
from isc_core.scene.lobe_fit import CONVENTION, Interval, LobeFit, LobeFitOutcome, LobeLight
from isc_core.shading.brdf.ggx import F0
from isc_core.shading.lights import DirectionalLight
from isc_core.shading.lobe_rendering import Lobe, lobe_under
from isc_core.shading.spherical_harmonics import real_sh
from tests.angles import degrees_between

LIGHT = np.zeros((9, 3))
LIGHT[0], LIGHT[1], LIGHT[2] = -1.0, 0.6, 0.9
LAMP = np.array([-0.4, 0.5, 0.77]) / np.linalg.norm([-0.4, 0.5, 0.77])
TURNED = np.array([-0.15, 0.62, 0.77]) / np.linalg.norm([-0.15, 0.62, 0.77])
ALPHA, STRENGTH = 0.2, 2.0


def dome(size: int, lean: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mask, height and normals of a dome that leans to the right."""
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    mask = np.hypot(x, y) < 0.42 * size
    height = np.sqrt(np.maximum(0.36 * size**2 - x**2 - y**2, 1)) + lean * x
    down, right = height_slopes(height)
    normal = np.stack([-right, down, np.ones_like(down)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    normal[~mask] = (0, 0, 1)
    return mask, np.where(mask, height - height[mask].min(), 0), normal


def glossy(size: int = 64, *, lean: float = 0.15, print_share: float = 0.0) -> Decomposition:
    """A result whose dome leans while the photo's does not, and whose lobe is that of the recovered
    light: its highlight lies elsewhere. With `print_share`, spots of print are taken for light.
    """
    true = dome(size)[2]
    mask, height, normal = dome(size, lean)
    shading, specular, image = (np.zeros((size, size, 3), np.float32) for _ in range(3))
    shading[mask] = np.exp(real_sh(normal[mask]) @ LIGHT)
    lamp = DirectionalLight(LAMP, np.full(3, STRENGTH))
    specular[mask] = lobe_under(Lobe(alpha=ALPHA, f0=F0), true[mask], lamp)
    if print_share:
        spots = np.random.default_rng(3).random((size // 4, size // 4)) < print_share
        specular = 0.3 * np.kron(spots, np.ones((4, 4)))[..., None] * mask[..., None]
        specular = np.ascontiguousarray(specular * np.ones(3), np.float32)
    reflectance = np.where(mask[..., None], np.float32(0.4), np.float32(0)) * np.ones(3, np.float32)
    diffuse = reflectance * shading
    image = diffuse + specular
    product = np.full(3, STRENGTH)
    predicted = np.zeros_like(specular)
    start = DirectionalLight(TURNED, product)
    predicted[mask] = lobe_under(Lobe(alpha=0.25, f0=F0), normal[mask], start)
    lobe = LobeFit(
        CONVENTION["ggx"], LobeFitOutcome.DETERMINED, 0.25, Interval(0.19, 0.33),
        (LobeLight(TURNED, 20.0, product, Interval(0.7 * product, 1.4 * product)),),
        None, None, 0.0, predicted,
    )  # fmt: skip
    return Decomposition(
        image, diffuse, specular, np.zeros_like(image), reflectance, shading,
        normal.astype(np.float32), height.astype(np.float32), mask, mask.astype(np.float32), LIGHT,
        Provenance(), lobe,
    )  # fmt: skip


def data_of(d: Decomposition) -> GlossData:
    work = working_scale(d)
    values = work.specular[work.mask]
    return GlossData(
        values, values > 0.9 * values.max(), np.ones(len(values)), *work.slopes, work.mask, 0.25,
        TURNED, 1.0,
    )  # fmt: skip


@pytest.mark.parametrize("moves", [True, False])
def test_the_gradient_is_that_of_finite_differences(moves: bool) -> None:
    d = glossy(32)
    data = data_of(d)
    bumps = HeightBumps.spaced(data.mask.shape, (3.0, 8.0), (0.2, 0.2)) if moves else None
    objective, rng = GlossObjective(data, bumps), np.random.default_rng(0)
    start = Gloss(
        0.2 * rng.normal(size=0 if bumps is None else bumps.size),
        np.array([1.3 * TURNED, [0.5, 0.1, 0.7]]),
        np.array([0.4, -0.2]), np.log(0.2), np.log(0.02),
    )  # fmt: skip
    x = start.packed()
    gradient, spare = np.empty_like(x), np.empty_like(x)
    objective(x, gradient)
    count = len(x) - 10
    for part in (slice(0, count), slice(count, count + 6), slice(-4, -2), slice(-2, None)):
        if not x[part].size:
            continue
        step = np.zeros_like(x)
        step[part] = rng.normal(size=x[part].size)
        up, down = (objective(x + s * 1e-5 * step, spare) for s in (1, -1))
        assert (up - down) / 2e-5 == pytest.approx(float(gradient @ step), rel=1e-4)


def test_bumps_of_a_finer_map_are_the_same_surface_and_have_the_slopes_asked_for() -> None:
    coarse = HeightBumps.spaced((60, 50), (4.0,), (0.3,))
    fine = HeightBumps.spaced((60, 50), (4.0,), (0.3,), 3)
    u = np.random.default_rng(0).normal(size=coarse.size)
    assert np.allclose(fine.height(u)[1::3, 1::3], 3 * coarse.height(u))
    slopes = height_slopes(fine.height(u))
    assert np.std(slopes) == pytest.approx(0.3, rel=0.15)
    g = np.random.default_rng(1).normal(size=(60, 50))
    assert (coarse.height(u) * g).sum() == pytest.approx(coarse.adjoint(g) @ u)


@pytest.mark.slow
def test_the_highlight_comes_to_lie_where_the_photo_shows_it() -> None:
    start = glossy()
    done = refine_gloss(start)
    d = done.result
    assert done.kept and done.before < 0.3 < 0.8 < done.after
    assert d.brdf is not None and not d.identity_errors().broken()
    for layer in ("image", "diffuse", "specular", "residual"):
        assert np.array_equal(getattr(d, layer), getattr(start, layer))
    true = start.specular[start.mask]
    error = np.square(d.brdf.predicted[d.mask] - true).sum() / np.square(true).sum()
    assert error < 0.1
    assert degrees_between(d.brdf.direction, LAMP) < degrees_between(TURNED, LAMP)
    assert 1 / 1.3 < d.brdf.alpha / ALPHA < 1.3  # type: ignore[operator]
    assert gloss_line(d.provenance.settings).startswith("gloss refined: 1 lamp explains")
    with pytest.raises(InputError, match="refined already"):
        refine_gloss(d)


@pytest.mark.slow
@pytest.mark.parametrize("known", ["shape", "light"])
def test_what_the_user_has_given_stays(known: str) -> None:
    start = replace(glossy(48), provenance=Provenance(input={"known": [known]}))
    done = refine_gloss(start)
    d = done.result
    assert d.brdf is not None and not d.identity_errors().broken()
    assert degrees_between(d.brdf.direction, TURNED) > 1, "the lamp moves"
    same = [np.array_equal(getattr(d, name), getattr(start, name)) for name in ("normal", "height")]
    assert all(same) if known == "shape" else not any(same)
    assert np.array_equal(d.illumination, start.illumination)


@pytest.mark.parametrize("found", [None, "shape", {"shape": 1}, 3])
def test_what_anybodys_file_says_was_given_may_be_anything(found: object) -> None:
    assert Provenance(input={"known": found}).known == frozenset()
    assert Provenance(input={"known": ["shape", 2]}).known >= {"shape"}


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_the_folder_keeps_them(tmp_path: Path) -> None:
    first, second = (refine_gloss(glossy(48)).result for _ in range(2))
    for name in ("normal", "height", "shading", "reflectance"):
        assert np.array_equal(getattr(first, name), getattr(second, name))
    save(first, tmp_path / "refined")
    again = load(tmp_path / "refined")
    assert again.brdf is not None and first.brdf is not None
    assert np.array_equal(again.brdf.predicted, first.brdf.predicted)
    assert np.allclose(again.brdf.direction, first.brdf.direction)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.1, 0.3])
def test_print_that_was_taken_for_light_keeps_the_start(share: float) -> None:
    start = glossy(96, print_share=share)
    done = refine_gloss(start)
    assert not done.kept
    assert done.result.brdf is start.brdf and done.result.normal is start.normal
    assert gloss_line(done.result.provenance.settings).startswith("gloss not refined: ")


def test_without_highlights_there_is_nothing_to_fit() -> None:
    start = glossy(32)
    matt = replace(start, diffuse=start.image, specular=np.zeros_like(start.specular))
    for d in (matt, replace(start, brdf=None)):
        done = refine_gloss(d)
        assert not done.kept and done.lamps == 0 and done.result.specular is d.specular
        assert done.outcome is GlossOutcome.NO_HIGHLIGHT
        assert "no highlight" in gloss_line(done.result.provenance.settings)


def test_large_maps_are_reduced_and_a_fit_can_be_cancelled() -> None:
    d = glossy(32)
    wide = replace(
        d, **{n: np.kron(getattr(d, n), np.ones((12, 12, 1), np.float32)) for n in (
            "image", "diffuse", "specular", "residual", "reflectance", "shading", "normal")},
        height=np.kron(d.height, np.ones((12, 12), np.float32)) * 12,
        mask=np.kron(d.mask, np.ones((12, 12), bool)),
    )  # fmt: skip
    work = working_scale(wide)
    assert work.step == 2 and max(work.mask.shape) <= 192
    assert np.allclose(work.reduced(wide.specular, wide.mask).mean(axis=2), work.specular)
    calls: list[None] = []

    def cancelled() -> bool:
        calls.append(None)
        return len(calls) > 3

    with pytest.raises(Cancelled):
        refine_gloss(d, monitor=Monitor(cancelled=cancelled))


@pytest.mark.parametrize("wrong", [{"lamps": 0}, {"lamps": 4}, {"steps": 0}, {"seed": -1}])
def test_options_out_of_range_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(InputError, match="lamps has to be 1 to 3"):
        GlossOptions(**wrong)


@pytest.mark.parametrize(
    ("note", "line"),
    [
        (None, ""),
        (7, ""),
        ({"outcome": []}, ""),
        ({"outcome": "no_highlight"}, "no highlight"),
        ({"outcome": "unlikely_reflectance"}, "less likely"),
        ({"outcome": "refined", "lamps": "x"}, "gloss refined"),
        ({"outcome": "refined", "lamps": 2, "held_out_after": 0.84}, "2 lamps explain 84 %"),
    ],
)
def test_the_note_of_anybodys_file_becomes_a_line_or_none(note: object, line: str) -> None:
    said = gloss_line({} if note is None else {"refine_gloss": note})
    assert line in said if line else not said
