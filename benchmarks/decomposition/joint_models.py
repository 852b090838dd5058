"""Compare the models on glossy photos with SIRFS on the photo and on the true diffuse image.

  python -m benchmarks.decomposition.joint_models --data ../shared/data/mit_berkeley_train
      --glossy DIR -o OUT [--objects a,b] [--sets level-25_natural] [--weights NPZ]
      [--models plain,joint] [--roundings K] [--unpredicted]

Sets: the laboratory originals, and every folder of DIR, as written by `isc synth glossy-mit`.
`--weights`: a scene network; by default the shipped one. Neither has learned from these objects.
`--roundings`: each photo is measured that often, all but the first time with values perturbed by
about 1e-7: SIRFS has many minima, and the last digit decides between them. Writes OUT/rows.jsonl,
one row per run, which is kept, and OUT/tables.md: geometric means of errors relative to plain
SIRFS, with the interval of resampled objects, and the share of the true diffuse image's gain that a
model reaches.
"""

import argparse
import math
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from benchmarks.program import run_program
from benchmarks.records import append_row, read_rows
from benchmarks.sirfs.mit_berkeley import rounded
from isc_core.datasets.mit_berkeley import MitBerkeleyObject, list_objects, load_object
from isc_core.decomposition.settings import LightPrior, ShapePrior
from isc_core.evaluation.evaluate import Estimate, paired_bootstrap
from isc_core.evaluation.metrics import score
from isc_core.evaluation.runner import RunnerOptions, make_runner
from isc_core.networks.scene_network import SceneNetwork
from isc_core.progress import Monitor
from isc_core.sirfs.priors.prior_file import shipped_prior_set

MODELS = ("plain", "mdr", "mbp", "joint", "true diffuse")
METRICS = ("height", "normal", "shading", "reflectance", "rs_mse", "light", "average")


def photo_of(folder: Path, name: str) -> tuple[MitBerkeleyObject, MitBerkeleyObject]:
    """Read an object as photographed and its diffuse image.

    Parameters
    ----------
    folder : Path
        The set; its name says which illumination's priors apply.
    name : str
        The object.

    Returns
    -------
    photo, diffuse : MitBerkeleyObject
        Both with the illumination set.
    """
    natural = "natural" in folder.name
    return tuple(  # type: ignore[return-value]
        replace(
            load_object(folder, name, "laboratory", kind),
            illumination="natural" if natural else "laboratory",
        )
        for kind in ("original", "diffuse")
    )


def run_model(
    model: str,
    photo: MitBerkeleyObject,
    diffuse: MitBerkeleyObject,
    network: SceneNetwork | None,
    *,
    predicted: bool = True,
) -> tuple[Estimate, float]:
    """Run a model on a photo.

    Parameters
    ----------
    model : str
        One of `MODELS`.
    photo, diffuse : MitBerkeleyObject
        The object as photographed, and its diffuse image.
    network : SceneNetwork or None
        Instead of the shipped one.
    predicted : bool
        Whether SIRFS expects what the network predicts, as users' runs do.

    Returns
    -------
    answer : Estimate
        The result.
    seconds : float
        Time taken.
    """
    truth = diffuse if model == "true diffuse" else photo
    options = RunnerOptions(
        "sirfs" if model in ("plain", "true diffuse") else model,
        light_prior=LightPrior.PREDICTED if predicted else LightPrior.DATASET,
        shape_prior=ShapePrior.PREDICTED if predicted else ShapePrior.SILHOUETTE,
    )
    began = time.perf_counter()
    answer = make_runner(options, shipped_prior_set(), network)(truth, Monitor())
    return answer, time.perf_counter() - began


def measure(given: argparse.Namespace) -> list[dict[str, object]]:
    """Measure what is missing; return all rows, old and new.

    Parameters
    ----------
    given : argparse.Namespace
        Arguments of the command line.

    Returns
    -------
    list of dict
        One row per set, object, model and rounding.
    """
    path = given.output / "rows.jsonl"
    rows = read_rows(path)
    network = SceneNetwork.read(given.weights) if given.weights else None
    done = {(row["set"], row["object"], row["model"], row.get("rounding", 0)) for row in rows}
    folders = [
        given.data,
        *(sorted(p for p in given.glossy.iterdir() if p.is_dir()) if given.glossy else []),
    ]
    for folder in folders:
        label = "laboratory originals" if folder == given.data else folder.name
        if given.sets and label not in given.sets:
            continue
        for name in given.objects or list_objects(folder, "laboratory"):
            wanted = [
                (rounding, model) for rounding in range(given.roundings) for model in given.models
            ]
            missing = [
                (rounding, model)
                for rounding, model in wanted
                if (label, name, model, rounding) not in done
            ]
            if not missing:
                continue
            photos = photo_of(folder, name)
            for rounding, model in missing:
                photo, diffuse = (rounded(one, rounding) for one in photos)
                answer, seconds = run_model(
                    model, photo, diffuse, network, predicted=not given.unpredicted
                )
                rows.append(
                    row_of(label, name, model, photo, answer, seconds) | {"rounding": rounding}
                )
                append_row(path, rows[-1])
    return rows


def row_of(
    label: str, name: str, model: str, photo: MitBerkeleyObject, answer: Estimate, seconds: float
) -> dict[str, object]:
    """Score an answer and print the average.

    Parameters
    ----------
    label, name, model : str
        Set, object and model.
    photo : MitBerkeleyObject
        Ground truth.
    answer : Estimate
        The result.
    seconds : float
        Time taken.

    Returns
    -------
    dict of str to object
        The row.
    """
    maps = {
        key: getattr(answer, key) for key in ("height", "normal", "shading", "reflectance", "light")
    }
    scores = score(photo, **maps)
    print(label, name, model, f"{scores.average:.5f}", flush=True)
    return {
        "set": label,
        "object": name,
        "model": model,
        "seconds": seconds,
        **asdict(scores),
        "average": scores.average,
    }


def tables(rows: list[dict[str, object]], models: Sequence[str] = MODELS) -> str:
    """Format the rows.

    Parameters
    ----------
    rows : list of dict
        All rows.
    models : sequence of str, optional
        Rows of the tables; the first is the reference. "plain" and "true diffuse" are among them.

    Returns
    -------
    str
        Markdown: a table for all glossy sets, and one per set.
    """
    values: dict[tuple[str, str, int], dict[str, dict[str, float]]] = defaultdict(dict)
    for row in rows:
        key = str(row["set"]), str(row["object"]), int(row.get("rounding", 0))  # type: ignore[call-overload]
        values[key][str(row["model"])] = {name: float(row[name]) for name in (*METRICS, "seconds")}  # type: ignore[arg-type]
    whole = {key: found for key, found in values.items() if all(model in found for model in models)}
    text = []
    groups = sorted({key[0] for key in whole})
    for title, members in [
        ("all glossy sets", [g for g in groups if g.startswith("level")]),
        *((g, [g]) for g in groups),
    ]:
        part = {key: found for key, found in whole.items() if key[0] in members}
        if len({name for _, name, _ in part}) < 2:
            continue
        text += [
            f"\n## {title}: {len({key[:2] for key in part})} photos\n",
            "| relative to plain | " + " | ".join((*METRICS, "seconds")) + " |",
        ]
        text.append("|---" * (len(METRICS) + 2) + "|")
        text += [_line(model, part) for model in models[1:]]
    return "\n".join(text) + "\n"


def _line(model: str, part: dict[tuple[str, str, int], dict[str, dict[str, float]]]) -> str:
    cells = []
    for metric in (*METRICS, "seconds"):
        logs: dict[str, dict[str, list[float]]] = {
            "plain": defaultdict(list),
            model: defaultdict(list),
            "true diffuse": defaultdict(list),
        }
        for (_, name, _), found in part.items():
            for who in logs:
                logs[who][name].append(math.log(found[who][metric]))
        mean = {who: [float(np.mean(of[name])) for name in sorted(of)] for who, of in logs.items()}
        ratio = paired_bootstrap(mean[model], mean["plain"], 0)
        ceiling = 1 - paired_bootstrap(mean["true diffuse"], mean["plain"], 0).ratio
        share = (
            f"; {(1 - ratio.ratio) / ceiling:.0%}"
            if ceiling > 0.05 and model != "true diffuse" and metric != "seconds"
            else ""
        )
        cells.append(f"{ratio.ratio:.3f} ({ratio.low:.3f}-{ratio.high:.3f}{share})")
    return f"| {model} | " + " | ".join(cells) + " |"


def _names(text: str) -> list[str]:
    return text.split(",")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="the MIT-Berkeley set")
    parser.add_argument("--glossy", type=Path, help="a run of isc synth glossy-mit")
    parser.add_argument("--weights", type=Path, help="a scene network (default: the shipped one)")
    parser.add_argument("--objects", type=_names, default=[], help="comma-separated (default: all)")
    parser.add_argument("--sets", type=_names, default=[], help="comma-separated (default: all)")
    parser.add_argument("--models", type=_names, default=MODELS, help="comma-separated models")
    parser.add_argument("--roundings", type=int, default=1, help="perturbations")
    parser.add_argument("--unpredicted", action="store_true", help="SIRFS without predictions")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    text = tables(measure(given))
    (given.output / "tables.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    run_program(main)
