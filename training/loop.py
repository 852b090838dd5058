"""The training loop of the networks.

Equation: the learning rate at step k of K is rate * min(1, (k + 1) / warm_up) * (1 + cos(pi k / K))
/ 2. The exported weights are a running average w' <- w' + (1 - d) (w - w') with
d = min(d_max, (k + 1) / (k + delay)).

Citation: optimisers: I. Loshchilov and F. Hutter, "Decoupled Weight Decay Regularization", 2019,
arXiv:1711.05101; for matrices: K. Jordan et al., "Muon", 2024, with the rates of J. Liu et al.
2025, arXiv:2502.16982.

With a limit of minutes, k / K is the share of the time that has passed.

Limits: one device. Processors without instructions for bfloat16 fit all weights by AdamW. The
gradient is clipped to norm 1. A resumed run draws other samples than the uninterrupted one would
have drawn.
"""

import argparse
import copy
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Protocol, TypeVar
from zipfile import is_zipfile

import numpy as np
import torch
from torch import nn
from torch.optim.swa_utils import get_ema_multi_avg_fn

from isc_core.cli.interface.values import count, not_negative, whole
from isc_core.errors import InputError
from isc_core.io.atomic import new_file, require_writable_file

from .devices import available_device, halves_are_fast

_REPORT_EVERY, _CHECKPOINT_EVERY = 100, 1000  # steps
_VALIDATION_BATCHES = 8
_SIDE_STEP = 32  # pixels
_CHECKPOINT_KEYS = {"step", "network", "average", "optimizers"}

Batch = tuple[torch.Tensor, ...]
DrawBatch = Callable[[np.random.Generator], Any]
Prepare = Callable[[Any], Any]


class Trainable(Protocol):
    """What the loop needs of a network besides `torch.nn.Module`."""

    def matrices(self) -> Sequence[nn.Parameter]:
        """Return the weights that are matrices: Muon fits them where it is fast."""

    def loss(self, batch: Batch) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Return the loss of a batch and its named terms.

        Parameters
        ----------
        batch : tuple of tensor
            As `DrawBatch` returns it.

        Returns
        -------
        loss : () tensor
        terms : dict of str to tensor
            Parts of the loss; may be empty.
        """

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights in the layout that the core reads."""


Net = TypeVar("Net", bound=Any)  # an nn.Module that is Trainable


@dataclass(frozen=True)
class Schedule:
    """Constants of the optimiser.

    Attributes
    ----------
    rate : float
        Peak learning rate.
    weight_decay : float
        Decoupled weight decay.
    warm_up : int
        Steps over which the rate rises linearly.
    average_limit : float
        Largest share of the old weights in the running average.
    average_delay : int
        Steps that delay the running average, > 1.
    """

    rate: float
    weight_decay: float = 1e-2
    warm_up: int = 100
    average_limit: float = 0.995
    average_delay: int = 20


@dataclass(frozen=True)
class RunOptions:
    """Options of one run, from the command line.

    Attributes
    ----------
    output : Path
        The weights (.npz). Checkpoints are written beside it (.pt).
    steps : int
        Number of optimiser steps.
    batch : int
        Samples per batch.
    seed : int
        Seed of the initial weights and of the samples.
    threads : int
        Threads of PyTorch; 0 keeps its default.
    workers : int
        Processes that draw samples; 0 draws them in the main process.
    resume : Path or None
        Checkpoint of an interrupted run to continue.
    device : str
        Where the network is fitted: "cpu" or "cuda".
    minutes : float
        Length of the run; 0: until `steps`.
    """

    output: Path
    steps: int
    batch: int
    seed: int = 0
    threads: int = 0
    workers: int = 0
    resume: Path | None = None
    device: str = "cpu"
    minutes: float = 0.0


def add_run_arguments(parser: argparse.ArgumentParser, steps: int, batch: int) -> None:
    """Add the options of `RunOptions` to a command line.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Changed in place.
    steps, batch : int
        Defaults.
    """
    add = parser.add_argument
    add("-o", "--output", type=Path, required=True, metavar="NPZ", help="where to write weights")
    add("--steps", type=whole, default=steps, help="optimiser steps (default: %(default)s)")
    add("--batch", type=whole, default=batch, help="samples per batch (default: %(default)s)")
    add("--seed", type=count, default=0, help="seed of weights and samples (default: %(default)s)")
    add("--threads", type=count, default=0, help="PyTorch threads (default: all)")
    add(
        "--workers",
        type=count,
        default=0,
        help="processes that draw samples; 0, the default: none, the fastest on a CPU",
    )
    add("--device", default="cpu", type=available_device, help="cpu or cuda (default: %(default)s)")
    add(
        "--minutes", type=not_negative, default=0, help="end after so long (default: after --steps)"
    )
    add("--resume", type=Path, metavar="PT", help="continue the run that wrote this checkpoint")


def photo_side(text: str) -> int:
    """Parse the side of photos on a command line.

    Parameters
    ----------
    text : str

    Returns
    -------
    int
        Pixels.

    Raises
    ------
    argparse.ArgumentTypeError
        If it is no multiple of 32, as the levels of the networks need it.
    """
    side = whole(text)
    if side % _SIDE_STEP:
        raise argparse.ArgumentTypeError(f"{text} is not a multiple of {_SIDE_STEP} pixels")
    return side


def run_options(arguments: argparse.Namespace) -> RunOptions:
    """Collect the options added by `add_run_arguments`.

    Parameters
    ----------
    arguments : argparse.Namespace

    Returns
    -------
    RunOptions

    Raises
    ------
    InputError
        If the output cannot be written: hours later would be too late.
    """
    require_writable_file(arguments.output)
    return RunOptions(
        arguments.output,
        arguments.steps,
        arguments.batch,
        arguments.seed,
        arguments.threads,
        arguments.workers,
        arguments.resume,
        arguments.device,
        arguments.minutes,
    )


class _Batches(torch.utils.data.IterableDataset[Batch]):  # type: ignore[misc]
    """Batches without end; each worker process has a random stream of its own."""

    def __init__(self, draw: DrawBatch, seed: int, first_step: int) -> None:
        self._draw, self._seed = draw, [seed, first_step]

    def __iter__(self) -> Iterator[Batch]:
        worker = torch.utils.data.get_worker_info()
        number = 0 if worker is None else int(worker.id)
        if worker is not None:
            seeds = np.random.default_rng([*self._seed, number, 3])
            torch.manual_seed(int(seeds.integers(2**31)))
            torch.set_num_threads(1)
        rng = np.random.default_rng([*self._seed, number])
        while True:
            yield self._draw(rng)


def fit(
    network: Net,
    draw: DrawBatch,
    schedule: Schedule,
    options: RunOptions,
    draw_validation: DrawBatch | None = None,
    prepare: Prepare = lambda batch: batch,
) -> Net:
    """Fit a network and write its weights.

    Parameters
    ----------
    network : nn.Module
        A `Trainable`, changed in place.
    draw : callable
        Draws a training batch; in worker processes.
    schedule : Schedule
        Constants of the optimiser.
    options : RunOptions
        Length, files and seeds of the run.
    draw_validation : callable, optional
        Draws a finished batch of held-out subjects. The same ones are used at every evaluation.
    prepare : callable, optional
        Makes what the network's loss takes of what was drawn.

    Returns
    -------
    nn.Module
        The network with averaged weights, as written to `options.output`.

    Raises
    ------
    InputError
        If a checkpoint cannot be read or does not fit the network.
    """
    if options.threads:
        torch.set_num_threads(options.threads)
    network.to(options.device)
    torch.backends.cudnn.benchmark = True  # batches have one size: the fastest kernels for it
    optimizers = _optimizers(network, schedule, options.device)
    held_out = [batch.to(options.device) for batch in _validation_batches(draw_validation, options)]
    average, clock = copy.deepcopy(network).eval(), _Clock(options)
    if options.resume is not None:
        clock.resume(_restore(_checkpoint(options.resume), network, average, optimizers))
    batches = _loader(draw, options, clock.step)
    report = _Report()
    while not clock.over:
        share = _rate_share(clock.step, clock.progress, schedule.warm_up)
        for group in chain(*(one.param_groups for one in optimizers)):
            group["lr"] = share * schedule.rate
        loss, terms = network.loss(prepare(next(batches)).to(options.device))
        network.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        for optimizer in optimizers:
            optimizer.step()
        _update_average(average, network, clock.step, schedule)
        clock.tick()
        report.add(clock.step, loss, terms, clock.over)
        if clock.step % _CHECKPOINT_EVERY == 0 or clock.over:
            _write(average, network, optimizers, clock, options.output)
            if held_out:
                print(f"  held out: {_formatted(_mean_terms(average, held_out))}", flush=True)
    return average


class _Clock:
    """Steps and time of a run, over interruptions."""

    def __init__(self, options: RunOptions) -> None:
        self._options, self._began = options, time.monotonic()
        self.step = 0

    def resume(self, state: tuple[int, float]) -> None:
        self.step, seconds = state
        self._began -= seconds

    @property
    def seconds(self) -> float:
        return time.monotonic() - self._began

    @property
    def progress(self) -> float:
        if self._options.minutes:
            return min(1.0, self.seconds / (60 * self._options.minutes))
        return self.step / self._options.steps

    @property
    def over(self) -> bool:
        return self.progress >= 1

    def tick(self) -> None:
        self.step += 1


def _optimizers(network: Net, schedule: Schedule, device: str) -> list[Any]:
    # Muon multiplies in bfloat16
    matrices = list(network.matrices()) if halves_are_fast(device) else []
    known = {id(weights) for weights in matrices}
    others = [weights for weights in network.parameters() if id(weights) not in known]
    common = {"lr": schedule.rate, "weight_decay": schedule.weight_decay}
    found: list[Any] = [torch.optim.AdamW(others, fused=True, **common)]
    if matrices:
        found.insert(0, torch.optim.Muon(matrices, adjust_lr_fn="match_rms_adamw", **common))
    return found


def _rate_share(step: int, progress: float, warm_up: int) -> float:
    return min(1.0, (step + 1) / warm_up) * 0.5 * (1 + math.cos(math.pi * progress))


def _loader(draw: DrawBatch, options: RunOptions, first: int) -> Iterator[Batch]:
    batches = _Batches(draw, options.seed, first)
    if not options.workers:
        return iter(batches)
    loader = torch.utils.data.DataLoader(
        batches, batch_size=None, num_workers=options.workers, prefetch_factor=8
    )
    return iter(loader)


def _validation_batches(draw: DrawBatch | None, options: RunOptions) -> list[Any]:
    if draw is None:
        return []
    rng = np.random.default_rng([options.seed, 2])
    return [draw(rng) for _ in range(_VALIDATION_BATCHES)]


def _mean_terms(network: Net, batches: Sequence[Any]) -> dict[str, float]:
    with torch.no_grad():
        found = [network.loss(batch) for batch in batches]
    whole = {"loss": float(np.mean([float(loss) for loss, _ in found]))}
    for name in found[0][1]:
        whole[name] = float(np.mean([float(terms[name]) for _, terms in found]))
    return whole


def _formatted(terms: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.4f}" for name, value in terms.items())


def _update_average(average: nn.Module, network: nn.Module, step: int, schedule: Schedule) -> None:
    """Move the running average toward the current weights."""
    kept_share = min(schedule.average_limit, (step + 1) / (step + schedule.average_delay))
    pairs = zip(average.state_dict().values(), network.state_dict().values(), strict=True)
    floats = [(kept, new) for kept, new in pairs if kept.is_floating_point()]
    kept, new = map(list, zip(*floats, strict=True))
    get_ema_multi_avg_fn(kept_share)(kept, new, step)


class _Report:
    """Prints smoothed losses every hundred steps; between, they stay on the device."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._smoothed: torch.Tensor | None = None
        self._count = 0

    def add(
        self, done: int, loss: torch.Tensor, terms: dict[str, torch.Tensor], last: bool
    ) -> None:
        self._count += 1
        values = torch.stack([loss, *terms.values()]).detach().float()
        before = torch.zeros_like(values) if self._smoothed is None else self._smoothed
        self._smoothed = torch.lerp(before, values, 0.01)
        if done % _REPORT_EVERY and not last:
            return
        means = (self._smoothed / (1 - 0.99**self._count)).tolist()
        shown = _formatted(dict(zip(["loss", *terms], means, strict=True)))
        seconds = time.monotonic() - self._began
        print(f"step {done}: {shown} ({seconds:.0f} s)", flush=True)


def _checkpoint(path: Path) -> dict[str, Any]:
    found = None
    try:
        with path.open("rb") as file:
            if is_zipfile(file):
                file.seek(0)
                found = torch.load(file, weights_only=True, map_location="cpu")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    except RuntimeError:  # an archive of something else
        found = None
    if not isinstance(found, dict) or not found.keys() >= _CHECKPOINT_KEYS:
        raise InputError(f"{path} is not a training checkpoint: give the .pt file of a run")
    return found


def _restore(
    kept: dict[str, Any], network: Net, average: Net, optimizers: list[Any]
) -> tuple[int, float]:
    """Restore a run; return the number of steps already done, and the seconds they took."""
    try:
        network.load_state_dict(kept["network"])
        average.load_state_dict(kept["average"])
        for optimizer, state in zip(optimizers, kept["optimizers"], strict=True):
            optimizer.load_state_dict(state)
    except (RuntimeError, ValueError) as error:
        reason = str(error).splitlines()[-1].strip()
        raise InputError(
            f"the checkpoint is of another network, or of another kind of processor: {reason}"
        ) from error
    return int(kept["step"]), float(kept.get("seconds", 0))


def _write(average: Net, network: Net, optimizers: list[Any], clock: _Clock, output: Path) -> None:
    """Write the averaged weights (.npz), and beside them the state to resume from (.pt)."""
    output.parent.mkdir(parents=True, exist_ok=True)
    with new_file(output) as temporary, temporary.open("wb") as file:
        # not compressed: that would save a fourteenth of the bytes, and cost each reader 4 ms a MB
        np.savez(file, **average.arrays())
    state = {
        "step": clock.step,
        "seconds": clock.seconds,
        "network": network.state_dict(),
        "average": average.state_dict(),
        "optimizers": [optimizer.state_dict() for optimizer in optimizers],
    }
    with new_file(output.with_suffix(".pt")) as temporary, temporary.open("wb") as file:
        torch.save(state, file)
