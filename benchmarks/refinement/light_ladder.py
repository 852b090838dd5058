"""What keeps a fitted light from being right: truths take the place of what was recovered, one
after the other.

  python -m benchmarks.refinement.light_ladder -o FOLDER --first 0 --count 8 [--size 192]

Steps, each with the light of a distant environment and with cast shadows:

- "shape": the true shape under the new lights alone; what else is the start's;
- "truth": the true shape and light;
- "a": the true shape, and the environment that is nearest to the true shading (so that the albedo
  is known), by non-negative least squares;
- "b": the true shape and the recovered layers, and the environment of `isc refine --light`, whether
  or not its rule keeps it;
- "known albedo": the recovered shape, and the environment that is nearest to the true shading;
- "known light": the recovered shape, and the true light;
- "c": the recovered shape and layers, as `isc refine --light`, whether or not its rule keeps it.

Printed for each: the errors of shading and reflectance over the start's, the error of the light
(relative RMS of the environment in front of the object, blurred by a lobe of about 17 degrees,
after one scale), the angle between the strongest lamps, what the object gains in PSNR under two new
directional lights, and whether the rule of the refinement holds. FOLDER keeps what was rendered.

Limits: what has two lamps of similar strength has no certain strongest one.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from benchmarks.program import run_program
from isc_core.evaluation.metrics import geometric_mean, scaled_mse
from isc_core.progress import Monitor
from isc_core.refinement.working_scale import working_scale
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.environment_map import (
    directions,
    environment_from_shading,
    resampled,
    solid_angles,
)
from synth.capture.truth import render_truth
from synth.refine.light_objective import shading_of
from synth.refine.refine import RefineOptions, fit_environment
from synth.refine.transport import Transport, transport_of
from synth.rendering import RenderOptions
from synth.scene.lights import DirectionalLight

from .scenes import posed, rendered, scene_of

_ROWS = 16
_TOWARD = directions(_ROWS).reshape(-1, 3)
_BLUR, _POINTS = 12.0, 2500
_MAPS = ("diffuse", "reflectance", "shading", "normal", "height", "mask", "environment")


@dataclass(frozen=True, eq=False)
class Step:
    """A step of the ladder.

    Attributes
    ----------
    name : str
    shading : (N, 3) ndarray
    radiance : (J, 3) ndarray
    transport : Transport
        Of the shape.
    diffuse : (N, 3) ndarray
        The diffuse layer, of which the reflectance is the quotient.
    kept : bool or None
        Whether the rule of the refinement holds, None if it was not asked.
    """

    name: str
    shading: np.ndarray
    radiance: np.ndarray
    transport: Transport
    diffuse: np.ndarray
    kept: bool | None = None


def truth_of(place: Path, number: int, size: int) -> dict[str, np.ndarray]:
    """Read the truth of a scene; render it if it is missing.

    Parameters
    ----------
    place : Path
        Folder of the scene.
    number : int
        Number of the scene.
    size : int
        Side of the image in pixels.

    Returns
    -------
    dict of str to ndarray
        True maps by name, `new` (2,) the pixels of the environment that are the new lights, and
        `new_shading` (2, H, W, 3) under them.
    """
    path = place / "ladder_truth.npz"
    if not path.exists():
        maps = rendered(number, size, _MAPS)
        scene, rng = posed(number, size)[1], np.random.default_rng([41, number])
        tilt = np.degrees(np.arccos(_TOWARD[:, 2]))
        usual = (tilt > 30) & (tilt < 60) & (_TOWARD[:, 1] > -0.3)
        new = np.array(
            [rng.choice(np.flatnonzero(usual & (side * _TOWARD[:, 0] > 0.3))) for side in (-1, 1)]
        )
        under = [
            render_truth(
                replace(scene, lights=(DirectionalLight(_TOWARD[pixel], np.full(3, np.pi)),)),
                RenderOptions(16, number),
            ).shading
            for pixel in new
        ]
        np.savez(path, **maps, new=new, new_shading=np.array(under))
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def steps(start: Decomposition, truth: dict[str, np.ndarray]) -> Iterator[Step]:
    """Climb the ladder.

    Parameters
    ----------
    start : Decomposition
        What the refinement starts from.
    truth : dict of str to ndarray
        From `truth_of`.

    Yields
    ------
    Step
        The start first.
    """
    mask, options = start.mask, RefineOptions(rows=_ROWS)
    diffuse, true_diffuse = (m[mask].astype(float) for m in (start.diffuse, truth["diffuse"]))
    wanted = truth["shading"][mask].astype(float)
    light = resampled(truth["environment"], _ROWS).reshape(-1, 3).astype(float)
    true_shape = replace(start, normal=truth["normal"], height=truth["height"])
    of_truth, of_start = (transport_of(d, _ROWS) for d in (true_shape, start))
    recovered = environment_from_shading(start.illumination, _ROWS, viewer=start.viewer)
    old = start.shading[mask].astype(float)
    first = Step("start", old, recovered.reshape(-1, 3).astype(float), of_start, diffuse)
    yield first
    yield replace(first, name="shape", transport=of_truth)
    yield _under("truth", light, of_truth, true_diffuse)
    yield _under("a", nearest(of_truth, wanted), of_truth, true_diffuse)
    fit = fit_environment(true_shape, working_scale(true_shape), of_truth, options, Monitor())
    kept = fit.after < fit.before and fit.explains_better
    yield Step("b", fit.shading, fit.radiance, of_truth, diffuse, kept)
    yield _under("known albedo", nearest(of_start, wanted), of_start, diffuse)
    yield _under("known light", light, of_start, diffuse)
    fit = fit_environment(start, working_scale(start), of_start, options, Monitor())
    kept = fit.after < fit.before and fit.explains_better
    yield Step("c", fit.shading, fit.radiance, of_start, diffuse, kept)


def nearest(transport: Transport, shading: np.ndarray) -> np.ndarray:
    """Return the environment whose shading is nearest to a given one, in the mean square.

    Parameters
    ----------
    transport : Transport
    shading : (N, 3) ndarray
        The direct part has the same colour everywhere.

    Returns
    -------
    (J, 3) ndarray
    """
    direct = shading - transport.indirect
    grey = direct.mean(axis=1)
    some = np.random.default_rng(0).choice(len(grey), min(_POINTS, len(grey)), replace=False)
    found, _ = nnls(transport.shadowed[some].astype(float), grey[some])
    return np.asarray(found[:, None] * direct.mean(axis=0) / grey.mean())


def scores(step: Step, mask: np.ndarray, truth: dict[str, np.ndarray]) -> np.ndarray:
    """Return the errors of a step.

    Parameters
    ----------
    step : Step
    mask : (H, W) ndarray of bool
    truth : dict of str to ndarray
        From `truth_of`.

    Returns
    -------
    (5,) ndarray
        Of shading, reflectance, light, degrees between the lamps, PSNR under the new lights.
    """
    reflectance = step.diffuse / np.maximum(step.shading, 1e-3 * step.shading.mean())
    size, albedo = solid_angles(_ROWS).reshape(-1), truth["reflectance"][mask].astype(float)
    relit = []
    for pixel, shading in zip(truth["new"], truth["new_shading"], strict=True):
        new = reflectance * step.transport.shadowed[:, pixel, None] * (np.pi / size[pixel])
        true = albedo * shading[mask]
        relit.append(10 * np.log10(np.square(true).max() / scaled_mse(true, new)))
    environment = resampled(truth["environment"], _ROWS).reshape(-1, 3).astype(float)
    blur = np.exp(_BLUR * (_TOWARD @ _TOWARD.T - 1)) * size
    seen, true = ((blur @ light)[_TOWARD[:, 2] > 0] for light in (step.radiance, environment))
    lamps = [_TOWARD[(blur @ light.mean(1)).argmax()] for light in (step.radiance, environment)]
    return np.array(
        [
            scaled_mse(truth["shading"][mask], step.shading),
            scaled_mse(albedo, reflectance),
            np.sqrt(scaled_mse(true, seen) / np.square(true).mean()),
            np.degrees(np.arccos(np.clip(lamps[0] @ lamps[1], -1, 1))),
            np.mean(relit),
        ]
    )


def blocked(step: Step) -> float:
    """Return the share of the light toward the visible surface that the shape blocks.

    Parameters
    ----------
    step : Step

    Returns
    -------
    float
        In [0, 1].
    """
    light = step.radiance.mean(axis=1)
    passed, all_light = (
        float((transport @ light).sum(dtype=float))
        for transport in (step.transport.shadowed, step.transport.unshadowed)
    )
    return 1 - passed / all_light


def _under(name: str, radiance: np.ndarray, transport: Transport, diffuse: np.ndarray) -> Step:
    shading = shading_of(transport.shadowed, radiance, transport.indirect)
    return Step(name, shading, radiance, transport, diffuse)


def main() -> None:
    """Run the ladder."""
    parser = argparse.ArgumentParser(description="what keeps a fitted light from being right")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("--size", type=int, default=192)
    options = parser.parse_args()
    rows: dict[str, list[np.ndarray]] = {}
    shadows: list[tuple[float, ...]] = []
    for number in range(options.first, options.first + options.count):
        scene = scene_of(options.output, number, options.size)
        truth, mask = truth_of(scene.folder.parent, number, options.size), scene.start.mask
        turn = np.clip((scene.start.normal[mask] * truth["normal"][mask]).sum(axis=1), -1, 1)
        print(f"{number} {scene.light}, normals {np.degrees(np.arccos(turn)).mean():.1f} degrees")
        hidden: dict[str, float] = {}
        first: np.ndarray | None = None
        for step in steps(scene.start, truth):
            found = scores(step, mask, truth)
            first = found if first is None else first
            ratios = np.array([*found[:2] / first[:2], *found[2:4], found[4] - first[4]])
            rows.setdefault(step.name, []).append(ratios)
            print(f"  {step.name:12s} {_text(ratios)} {_RULE[step.kept]}", flush=True)
            if step.name in ("truth", "known light"):
                hidden[step.name] = blocked(step)
        shadows.append(tuple(hidden.values()))
        print(
            "  of the true light blocked: true shape {:.3f}, recovered {:.3f}".format(*shadows[-1])
        )
    print(
        "blocked, median: true shape {:.3f}, recovered {:.3f}".format(*np.median(shadows, axis=0))
    )
    for name, each in rows.items():
        shading, reflectance, light, lamp, relit = np.transpose(each)
        means = np.array([geometric_mean(shading), geometric_mean(reflectance)])
        print(f"{name:14s} {_text(np.array([*means, *np.median([light, lamp, relit], axis=1)]))}")


_RULE = {None: "", True: "kept", False: "start stays"}


def _text(values: np.ndarray) -> str:
    return (
        f"shading x{values[0]:.2f}  reflectance x{values[1]:.2f}  light {values[2]:.2f}  "
        f"lamp {values[3]:3.0f}  relit {values[4]:+.1f} dB"
    )


if __name__ == "__main__":
    run_program(main)
