"""How strong should predicted normals, shading and light be in SIRFS?

  python -m benchmarks.sirfs.soft_terms --data FOLDER --names cup1,frog1 --json weights.json
  python -m benchmarks.sirfs.soft_terms --data FOLDER --names all --weights SCENE.npz

FOLDER is `mit_berkeley_train`. Each object is solved by the protocol of the reference, with priors
fitted to the other nine. With `--weights`, predictions are those of a scene network from these
weights. Else they are simulated: the truth with smooth Gaussian errors, normals off by
`--degrees` on average, log shading by `--shading`, light coefficients by `--light`. Their stated
deviations are right for each pixel; neighbouring errors are correlated, as those of networks are,
so the weights that are found are those of predictions calibrated pixel by pixel.

Ways are those of `ways`. With normals, the solver starts once for each of `--domes`, the factor on
the silhouette's dome; by default as usual. Errors are geometric means over objects and noises,
relative to no prediction at all, in the same illumination's priors: those of the light, or what
`--solve-as` says.

Limits: errors of the three predictions are independent here; a network's are not.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from benchmarks.program import run_program
from isc_core.datasets.mit_berkeley import MitBerkeleyObject, load_natural_lights, load_object
from isc_core.decomposition.models import solve
from isc_core.decomposition.settings import ILLUMINATIONS
from isc_core.evaluation.metrics import score, truth_normal
from isc_core.evaluation.runner import RunnerOptions, reference_task
from isc_core.networks.scene_network import SceneNetwork, predict_scene
from isc_core.prior_fitting.fit import FitOptions, fit_priors
from isc_core.prior_fitting.statistics import collect_statistics
from isc_core.prior_fitting.training_objects import read_training_objects
from isc_core.scene.light_coefficients_estimate import LightCoefficientsEstimate
from isc_core.scene.normal_estimate import NormalEstimate
from isc_core.scene.shading_estimate import ShadingEstimate
from isc_core.shading.spherical_harmonics import (
    light_from_reference,
    normal_from_reference,
    real_sh,
)
from isc_core.shading.surface_stencils import normals
from isc_core.sirfs.priors.prior_set import PriorSet
from isc_core.sirfs.settings import Start, prediction_weights

from .leave_one_out import METRICS, without
from .mit_berkeley import LIGHTS, write_json
from .ways import Predictions, with_way

_NONE = "-:-:-"  # what all ways are compared with
WAYS = f"{_NONE},.2:-:-,-:.2:-,-:-:4,.2:.2:4,.5:.5:1,1:1:1,1:3:1"
_CORRELATED = 15.0  # pixels: standard deviation of the filter that makes errors smooth


@dataclass(frozen=True)
class Noise:
    """Size of the simulated errors.

    Attributes
    ----------
    degrees : float
        Mean angle of the normals' errors.
    shading, light : float
        Standard deviations of log shading and of light coefficients.
    """

    degrees: float
    shading: float
    light: float


@dataclass(frozen=True)
class Job:
    """One solve: an object in a light, a way, and the number of its noise."""

    data: Path
    name: str
    illumination: str
    way: str
    number: int
    noise: Noise
    starts: tuple[Start, ...]
    priors: PriorSet
    weights: Path | None = None
    solved_as: str | None = None


def run_job(job: Job) -> tuple[Job, list[float], int]:
    """Solve one object.

    Parameters
    ----------
    job : Job
        The solve.

    Returns
    -------
    job : Job
        As given.
    errors : list of float
        In the order of `METRICS`.
    evaluations : int
        Of the objective.
    """
    truth = load_object(job.data, job.name, job.illumination, "diffuse")
    options = RunnerOptions(threads=1)
    task = reference_task(truth, options, job.priors)
    if job.solved_as is not None:
        task = replace(task, settings=replace(task.settings, illumination=job.solved_as))
    seen = simulated(truth, job) if job.weights is None else of_network(truth, job.weights)
    usual = prediction_weights(task.settings.illumination)
    if job.starts:
        usual = replace(usual, starts=job.starts)
    found = solve(with_way(task, seen, job.way, usual))
    normal = normal_from_reference(normals(found.height))
    light = light_from_reference(found.light)
    shading = np.exp(real_sh(normal) @ light)
    errors = score(
        truth,
        height=found.height,
        normal=normal,
        shading=shading,
        reflectance=truth.image / shading,
        light=light,
    )
    return job, [getattr(errors, m) for m in METRICS], found.diagnostics.evaluations or 0


def of_network(truth: MitBerkeleyObject, weights: Path) -> Predictions:
    """Predict normals, shading and light by a scene network.

    Parameters
    ----------
    truth : MitBerkeleyObject
        Its image is read.
    weights : Path
        Archive of the network.

    Returns
    -------
    Predictions
    """
    found = predict_scene(truth.image, truth.mask, SceneNetwork.read(weights))
    return Predictions(found.normals, found.shading, found.light)


def simulated(truth: MitBerkeleyObject, job: Job) -> Predictions:
    """Simulate predictions near the truth.

    Parameters
    ----------
    truth : MitBerkeleyObject
    job : Job
        Number and size of the noise.

    Returns
    -------
    Predictions
    """
    rng = np.random.default_rng([job.number, LIGHTS.index(job.illumination)])
    normal = truth_normal(truth.height)
    known = truth.valid & np.isfinite(normal).all(axis=-1) & (truth.shading > 0).all(axis=-1)
    normal = np.where(known[..., None], normal, 0)
    seen = noisy_normals(normal, known, job.noise.degrees, rng)
    light = light_from_reference(truth.light)
    error = job.noise.shading * _smooth(known, 3, rng)
    exact = np.log(np.where(known[..., None], truth.shading, 1))  # shadows and all
    shading = np.where(known[..., None], exact + error, 0)
    predicted = ShadingEstimate(shading, np.where(known, job.noise.shading, 0))
    covariance = job.noise.light**2 * np.kron(0.8 + 0.2 * np.eye(3), np.eye(9))
    off = np.linalg.cholesky(covariance) @ rng.standard_normal(27)
    lit = LightCoefficientsEstimate(light + off.reshape(3, 9).T, covariance)
    return Predictions(seen, predicted, lit)


def noisy_normals(
    normal: np.ndarray, known: np.ndarray, degrees: float, rng: np.random.Generator
) -> NormalEstimate:
    """Turn normals by smooth random angles.

    Parameters
    ----------
    normal : (H, W, 3) ndarray
        True normals.
    known : (H, W) bool ndarray
        Where they are known.
    degrees : float
        Mean angle.
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    NormalEstimate
        Its deviation is that of the object's errors.
    """
    tilt = np.cross(normal, _smooth(known, 3, rng))
    size = np.linalg.norm(tilt, axis=-1, keepdims=True)
    angle = size * np.radians(degrees) / size[known].mean()
    turned = normal * np.cos(angle) + tilt / np.maximum(size, 1e-9) * np.sin(angle)
    front = np.maximum(turned[..., 2:], 0.02)
    turned = np.concatenate([turned[..., :2], front], axis=-1)
    turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
    deviation = float(np.sqrt(np.square((turned - normal)[known][:, :2]).mean()))
    return NormalEstimate(np.where(known[..., None], turned, 0), np.where(known, deviation, 0))


def _smooth(known: np.ndarray, channels: int, rng: np.random.Generator) -> np.ndarray:
    """Noise (H, W, C) of deviation 1 inside `known`, four fifths of it smooth."""
    white = rng.standard_normal((*known.shape, channels))
    parts = [ndimage.gaussian_filter(white, (s, s, 0)) for s in (_CORRELATED, _CORRELATED / 5)]
    wide, fine = (part / part[known].std() for part in parts)
    noise = 0.8 * wide + 0.6 * fine
    return np.asarray((noise - noise[known].mean(axis=0)) / noise[known].std())


def jobs(given: argparse.Namespace) -> list[Job]:
    """Fit the folds and list all solves.

    Parameters
    ----------
    given : argparse.Namespace
        The command's options.

    Returns
    -------
    list of Job
    """
    statistics = collect_statistics(read_training_objects(given.data))
    lights, names = load_natural_lights(given.data), given.names.split(",")
    noise = Noise(given.degrees, given.shading, given.light)
    starts = tuple(Start(float(dome), light=1) for dome in given.domes.split(",") if dome)
    made = []
    for name in statistics if given.names == "all" else names:
        priors = fit_priors(without(statistics, name), lights, FitOptions())
        made += [
            Job(
                given.data,
                name,
                illumination,
                way,
                number,
                noise,
                starts,
                priors,
                given.weights,
                given.solve_as,
            )
            for illumination in given.lights.split(",")
            for way in dict.fromkeys((_NONE, *given.ways.split(",")))
            for number in range(given.noises if way != _NONE else 1)
        ]
    return made


def report(found: dict[tuple[str, str], dict[str, list[list[float]]]]) -> None:
    """Print errors relative to no prediction, the average with its interval over objects.

    Parameters
    ----------
    found : dict of (str, str) to dict
        By illumination and way, the errors and evaluations of each object's noises; no prediction
        is among the ways.
    """
    heads = "light", "way", "N", "S", "R", "L", "avg (95 %; largest)", "evaluations"
    print("\n| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for (illumination, way), objects in found.items():
        logs = {name: np.log(rows).mean(axis=0) for name, rows in objects.items()}
        base = found[illumination, _NONE]
        none = {name: np.log(base[name]).mean(axis=0) for name in objects}
        gain = np.array([logs[name] - none[name] for name in logs])
        ratio, averages = np.exp(gain.mean(axis=0)), gain[:, : len(METRICS)].mean(axis=1)
        again = np.random.default_rng(0).integers(len(gain), size=(2000, len(gain)))
        low, high = np.exp(np.quantile(averages[again].mean(axis=1), (0.025, 0.975)))
        average = (
            f"{np.exp(averages.mean()):.2f} ({low:.2f}-{high:.2f}; {np.exp(averages.max()):.2f})"
        )
        row = [*(f"{value:.2f}" for value in ratio[[1, 2, 3, 5]]), average, f"{ratio[-1]:.2f}"]
        print(f"| {illumination} | {way} | " + " | ".join(row) + " |")


def main() -> None:
    """Run the command line."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--data", type=Path, required=True, help="folder mit_berkeley_train")
    options.add_argument("--names", default="cup1,frog1,panther", help='objects, or "all"')
    options.add_argument("--weights", type=Path, help="archive of a scene network")
    options.add_argument("--lights", default=",".join(LIGHTS), help="default: %(default)s")
    options.add_argument("--solve-as", choices=ILLUMINATIONS, help="default: as what it is")
    options.add_argument(
        "--ways", default=WAYS, help="comma-separated, see above; no prediction is added"
    )
    options.add_argument("--noises", type=int, default=1, help="noises per object and light")
    options.add_argument("--degrees", type=float, default=18.0, help="of normals")
    options.add_argument("--shading", type=float, default=0.15, help="of log shading")
    options.add_argument("--light", type=float, default=0.3, help="of light coefficients")
    options.add_argument("--domes", default="", help="starts: factors on the silhouette's dome")
    options.add_argument("--processes", type=int, default=2, help="parallel processes")
    options.add_argument("--json", type=Path, help="JSON file to write")
    given = options.parse_args()
    found: dict[tuple[str, str], dict[str, list[list[float]]]] = {}
    with ProcessPoolExecutor(given.processes) as pool:
        for job, errors, evaluations in pool.map(run_job, jobs(given)):
            rows = found.setdefault((job.illumination, job.way), {}).setdefault(job.name, [])
            rows.append([*errors, float(evaluations)])
            average = float(np.exp(np.log(errors).mean()))
            print(f"{job.name:9s} {job.illumination:10s} {job.way:10s} {average:.5f}", flush=True)
    report(found)
    write_json(given.json, {f"{light} {way}": value for (light, way), value in found.items()})


if __name__ == "__main__":
    run_program(main)
