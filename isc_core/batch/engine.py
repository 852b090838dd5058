"""Dask's scheduler and workers, local or at an address, and the stream of jobs.

Citation: M. Rocklin, "Dask: Parallel Computation with Blocked algorithms and Task Scheduling"
(2015), doi:10.25080/Majora-7b98e3ed-013.

Only a window of jobs is submitted to the scheduler at any time, a few for each worker, so that a
stream of any length needs the same memory. Workers that die are replaced and their images retried.
`attempts` identifies the image that kills them; the scheduler's own count also blames the images
queued on the same worker.

Limits: one image at a time in a worker process, so workers of a cluster should have one thread each
(`dask worker --nthreads 1`). Local workers listen on 127.0.0.1 only, but any user of the machine
can connect.
"""

import logging
import math
import os
import queue
import re
import signal
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec
from multiprocessing import resource_tracker
from typing import Any

from ..errors import InputError
from ..extras import install_command
from .item import FAILED, ImageJob, ImageOutcome, Outcomes
from .work import process

_POLL_SECONDS = 0.2  # interval of checks for cancellation
_JOBS_PER_IMAGE = 3  # submitted jobs per image in progress
_ALLOWED_FAILURES = 100  # failures that the scheduler allows per job; `attempts` stops earlier
_CHECK_SECONDS = 2.0  # interval of checks of the workers
_IDLE_SECONDS = 900.0  # without any worker, before the run is aborted
_CLUSTER_TIMEOUT = 60.0
_LEAST_MEMORY = 2e8  # bytes of a worker; an idle one takes 1.4e8
_MAX_STARTS = 3  # attempts to start local workers
_LOST = "the connection to the scheduler is lost: run the same command again to resume"

Client = Any  # Dask is optional


@dataclass(frozen=True)
class WorkerOptions:
    """Options of the workers of a run.

    Attributes
    ----------
    workers : int
        Number of processes; 0 for one per core or group of `threads` cores.
    threads : int
        Threads of each image; 0 shares the cores among the workers.
    memory : str
        Of each worker, as Dask reads it: "4GB", "auto", or "0" for no limit.
    scheduler : str
        Address of a cluster; the other fields are then ignored.
    processes : bool
        False uses threads of this process, for tests and for stores that only this process can
        access.
    """

    workers: int = 0
    threads: int = 0
    memory: str = "auto"
    scheduler: str = ""
    processes: bool = True

    def sized(self) -> "WorkerOptions":
        """Return the options with zeros replaced by numbers."""
        if hasattr(os, "sched_getaffinity"):
            cores = len(os.sched_getaffinity(0))
        else:
            cores = os.cpu_count() or 1
        workers = self.workers or max(1, cores // max(self.threads, 1))
        return replace(self, workers=workers, threads=self.threads or max(1, cores // workers))

    def check(self) -> None:
        """Check the memory of local workers.

        Raises
        ------
        InputError
            If it is not an amount, or if even an idle worker exceeds it: Dask would restart the
            workers for ever.
        """
        if self.scheduler or self.memory == "auto":
            return
        try:
            amount = _bytes_of(self.memory)
        except ValueError as error:
            raise InputError(f"--memory {self.memory}: {error}") from error
        if amount and not _LEAST_MEMORY <= amount < math.inf:
            raise InputError(
                f"--memory {self.memory}: a worker needs at least {_LEAST_MEMORY / 1e6:.0f}MB: "
                "give an amount such as 4GB, or 0 for no limit"
            )


def _bytes_of(memory: str) -> float:
    """An amount of memory as Dask reads it: numbers up to 1 are shares of the machine's."""
    from dask.utils import parse_bytes
    from distributed.system import MEMORY_LIMIT

    try:
        amount = float(memory)
    except ValueError:
        return float(parse_bytes(memory))
    return amount * MEMORY_LIMIT if 0 < amount <= 1 else amount


def require_dask() -> None:
    """Raise `InputError` if Dask is not installed."""
    try:
        import dask.distributed  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"isc batch needs Dask ({error}): install it with `{install_command('batch')}`"
        ) from error


@contextmanager
def connected(options: WorkerOptions) -> Iterator[Client]:
    """Provide a client of the cluster at `options.scheduler`, or of a local one.

    Parameters
    ----------
    options : WorkerOptions

    Returns
    -------
    dask.distributed.Client

    Raises
    ------
    InputError
        If there is no scheduler or no worker.
    """
    import dask
    from dask.distributed import Client as DaskClient

    with ExitStack() as stack:
        if options.scheduler:
            try:
                client = stack.enter_context(
                    DaskClient(options.scheduler, timeout=10, set_as_default=False)
                )
                client.wait_for_workers(1, timeout=_CLUSTER_TIMEOUT)
            except TimeoutError as error:
                raise InputError(
                    f"--scheduler {options.scheduler}: no worker within {_CLUSTER_TIMEOUT:.0f} s: "
                    "start workers"
                ) from error
            except (OSError, ValueError) as error:
                raise InputError(
                    f"--scheduler {options.scheduler}: cannot be reached: {error}"
                ) from error
        else:
            stack.enter_context(dask.config.set(_configuration(options)))
            cluster = stack.enter_context(_local_cluster(options))
            client = stack.enter_context(DaskClient(cluster, set_as_default=False))
        yield client


def _configuration(options: WorkerOptions) -> dict[str, object]:
    """Dask configuration for local workers.

    A worker that exceeds its memory is terminated, never paused: paused workers would wait forever.
    Libraries get the image's threads. Dask's default environment makes the allocator return every
    64 kB at once, which costs small images a third of their time.
    """
    memory, threads = "distributed.worker.memory", str(options.threads)
    names = (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "NUMBA_NUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    )
    return {
        "distributed.nanny.pre-spawn-environ": dict.fromkeys(names, threads),
        "distributed.scheduler.allowed-failures": _ALLOWED_FAILURES,
        "distributed.scheduler.worker-saturation": 1.0,
        # time to restart; on a busy machine it exceeds the default of 15 s
        "distributed.deploy.lost-worker-timeout": "5 minutes",
        # the profiler keeps an hour of samples: half a megabyte per image
        "distributed.worker.profile.enabled": False,
        f"{memory}.target": False,
        f"{memory}.spill": False,
        f"{memory}.pause": False,
        f"{memory}.terminate": 0.95,
    }


def _local_cluster(options: WorkerOptions, starts: int = _MAX_STARTS) -> Any:
    """Start local workers, with up to `starts` attempts if one is lost before all are ready. Raises
    `InputError`.
    """
    from dask.distributed import LocalCluster

    try:
        with _without_interrupts(), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Port ")  # another port is used, and announced
            return LocalCluster(
                n_workers=options.workers,
                threads_per_worker=1,
                processes=options.processes,
                memory_limit=options.memory,
                dashboard_address="127.0.0.1:8787",
                silence_logs=logging.CRITICAL,
            )
    except ValueError as error:
        raise InputError(f"--memory {options.memory}: {error}") from error
    except RuntimeError as error:
        if starts > 1:
            return _local_cluster(options, starts - 1)
        raise InputError(
            f"the workers could not be started ({error}): run the same command again"
        ) from error


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Let processes and threads that are started in this block ignore Ctrl-C.

    It reaches every process of a terminal; this one handles it.
    """
    # multiprocessing's own process; starting it unblocks signals in this thread
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def dashboard(client: Client) -> tuple[str, ...]:
    """Return a note with the address of Dask's dashboard.

    Parameters
    ----------
    client : dask.distributed.Client

    Returns
    -------
    tuple of str
        Empty without a dashboard, whose pages need Bokeh.
    """
    link = client.dashboard_link if find_spec("bokeh") else None
    return (f"Dask's dashboard: {link}",) if link else ()


def run_jobs(
    client: Client,
    jobs: Iterator[ImageJob],
    tick: Callable[[], None],
    task: Callable[[ImageJob], Outcomes] = process,
) -> Iterator[tuple[ImageJob, Outcomes]]:
    """Run every job and yield it with its outcomes, in order of completion.

    Parameters
    ----------
    client : dask.distributed.Client
    jobs : iterator of ImageJob
    tick : callable
        Called several times a second; an exception from it ends the work.
    task : callable
        Processes a job in a worker.

    Returns
    -------
    iterator of (ImageJob, Outcomes)

    Raises
    ------
    InputError
        If the scheduler, or all workers, are lost.
    """
    completed: queue.SimpleQueue[Any] = queue.SimpleQueue()
    waiting: dict[str, tuple[ImageJob, Any]] = {}
    workers, remaining = _WorkerMonitor(client), True
    while remaining or waiting:
        tick()
        workers.check()
        while remaining and len(waiting) < workers.window:
            if (job := next(jobs, None)) is None:
                remaining = False
                break
            key = f"isc-{job.plan.run}-{job.number}"
            future = client.submit(task, job, key=key, pure=False, retries=0)
            waiting[key] = job, future
            future.add_done_callback(completed.put)
        for future in _completed(completed):
            # Its worker was lost before it reported; another one repeats the job.
            if future.status in ("pending", "lost"):
                future.add_done_callback(completed.put)
                continue
            job, _ = waiting.pop(future.key)
            outcomes = _outcomes(future, job)
            future.release()
            yield job, outcomes


class _WorkerMonitor:
    """Monitors the workers: the number of jobs to submit ahead, and whether any worker is alive."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._expected = 0 if client.cluster is None else len(client.cluster.workers)
        self._last_check, self._last_worker = float("-inf"), time.monotonic()
        self.window = _JOBS_PER_IMAGE

    def check(self) -> None:
        """Every few seconds, restart local workers that were lost.

        Raises `InputError` if the scheduler or all workers are lost.
        """
        if (now := time.monotonic()) - self._last_check < _CHECK_SECONDS:
            return
        self._last_check = now
        if self._client.status != "running":
            raise InputError(_LOST)
        alive = len(self._client.scheduler_info(n_workers=-1)["workers"])
        if self._expected:
            self._client.cluster.scale(self._expected)
        if alive:
            self._last_worker = now
        elif now - self._last_worker > _IDLE_SECONDS:
            raise InputError(
                f"no worker for {_IDLE_SECONDS:.0f} s: start workers, and run the same "
                "command again"
            )
        self.window = _JOBS_PER_IMAGE * max(1, alive, self._expected)


def _completed(completed: "queue.SimpleQueue[Any]") -> Iterator[Any]:
    """Futures that have completed; waits a moment if there are none."""
    try:
        yield completed.get(timeout=_POLL_SECONDS)
        while True:
            yield completed.get_nowait()
    except queue.Empty:
        return


def _outcomes(future: Any, job: ImageJob) -> Outcomes:
    from dask.distributed import KilledWorker

    if future.status == "finished":
        outcomes: Outcomes = future.result()
        return outcomes
    if future.status != "error":
        raise InputError(_LOST)
    error = future.exception()
    if isinstance(error, KilledWorker):
        reason = "workers crashed while processing it: it may need more memory than they have"
    else:
        text = re.sub(r"\s+", " ", str(error))
        reason = f"internal error, please report it: {type(error).__name__}: {text}"
    return {job.name: ImageOutcome(FAILED, reason)}
