"""Dask's scheduler and workers, started here or found at an address, and the stream of jobs.

Citation: M. Rocklin, "Dask: Parallel Computation with Blocked algorithms and Task Scheduling"
(2015), doi:10.25080/Majora-7b98e3ed-013.

A window of jobs is at the scheduler at any time, a few for each worker, so that a stream of any
length needs the same memory. Workers that die are replaced and their images tried again. `attempts`
identifies the image that kills them; the scheduler's own count also blames the images queued on the
same worker.

Limits: one image at a time in a worker process, so workers of a cluster should have one thread each
(`dask worker --nthreads 1`). Local workers listen on 127.0.0.1 only, but any user of this machine
can connect.
"""

import logging
import os
import queue
import re
import signal
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any

from ..errors import InputError
from .item import FAILED, ImageJob, ImageOutcome
from .work import process

_DEAL_SECONDS = 0.2  # between two looks at whether to stop
_AHEAD = 3  # jobs at the scheduler for each image that is run_jobs on
_SUSPICION = 100  # of the scheduler, before it gives a job up: `attempts` does before
_LOOK_SECONDS = 2.0  # between two looks after the workers
_LONELY_SECONDS = 900.0  # without any worker, before the run gives up
_CLUSTER_PATIENCE = 60.0
_STARTS = 3  # of workers that are lost while they start
_LOST = "the scheduler is lost: give the same command again; what is finished stays"

Client = Any  # Dask is optional


@dataclass(frozen=True)
class Crew:
    """The workers of a run.

    Attributes
    ----------
    workers : int
        Processes; 0 for as many as the cores allow.
    threads : int
        Threads of each image; 0 shares the cores among the workers.
    memory : str
        Of each worker, as Dask reads it: "4GB", "auto", or "0" for no limit.
    scheduler : str
        Address of a cluster; the other fields are then ignored.
    processes : bool
        False uses threads of this process, for tests and for stores that only this process sees.
    """

    workers: int = 0
    threads: int = 0
    memory: str = "auto"
    scheduler: str = ""
    processes: bool = True

    def sized(self) -> "Crew":
        """Return the crew with numbers in place of zeros."""
        cores = (
            len(os.sched_getaffinity(0))
            if hasattr(os, "sched_getaffinity")
            else os.cpu_count() or 1
        )
        workers = self.workers or max(1, cores // max(self.threads, 1))
        return Crew(
            workers,
            self.threads or max(1, cores // workers),
            self.memory,
            self.scheduler,
            self.processes,
        )


def require_dask() -> None:
    """Raise `InputError` if Dask is not installed."""
    try:
        import dask.distributed  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"isc batch needs Dask ({error}): install it with `pip install 'isc3d[batch]'`"
        ) from error


@contextmanager
def connected(crew: Crew) -> Iterator[Client]:
    """Provide a client of the cluster at `crew.scheduler`, or of a local one.

    Parameters
    ----------
    crew : Crew

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
        if crew.scheduler:
            try:
                client = stack.enter_context(
                    DaskClient(crew.scheduler, timeout=10, set_as_default=False)
                )
                client.wait_for_workers(1, timeout=_CLUSTER_PATIENCE)
            except TimeoutError as error:
                raise InputError(
                    f"--scheduler {crew.scheduler}: no worker within {_CLUSTER_PATIENCE:.0f} s: "
                    "start some"
                ) from error
            except (OSError, ValueError) as error:
                raise InputError(
                    f"--scheduler {crew.scheduler}: cannot be reached: {error}"
                ) from error
        else:
            stack.enter_context(dask.config.set(_configuration(crew)))
            cluster = stack.enter_context(_local_cluster(crew))
            client = stack.enter_context(DaskClient(cluster, set_as_default=False))
        yield client


def _configuration(crew: Crew) -> dict[str, object]:
    """Dask's, for workers of this machine.

    A worker that is full of memory is ended, never paused: paused workers would wait for ever.
    Libraries get the image's threads. What Dask sets by itself would make the allocator give back
    every 64 kB at once, which costs small images a third of their time.
    """
    memory, threads = "distributed.worker.memory", str(crew.threads)
    names = (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "NUMBA_NUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    )
    return {
        "distributed.nanny.pre-spawn-environ": dict.fromkeys(names, threads),
        "distributed.scheduler.allowed-failures": _SUSPICION,
        "distributed.scheduler.worker-saturation": 1.0,
        # to start again; on a busy machine that takes more than the usual 15 s
        "distributed.deploy.lost-worker-timeout": "5 minutes",
        # keeps its samples of an hour: half a megabyte an image
        "distributed.worker.profile.enabled": False,
        f"{memory}.target": False,
        f"{memory}.spill": False,
        f"{memory}.pause": False,
        f"{memory}.terminate": 0.95,
    }


def _local_cluster(crew: Crew, starts: int = _STARTS) -> Any:
    """Workers of this machine; all begin anew, up to so many `starts`, where one is lost before
    they are ready. Raises `InputError`.
    """
    from dask.distributed import LocalCluster

    try:
        with _without_interrupts(), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Port ")  # another is taken, and announced
            return LocalCluster(
                n_workers=crew.workers,
                threads_per_worker=1,
                processes=crew.processes,
                memory_limit=crew.memory,
                dashboard_address="127.0.0.1:8787",
                silence_logs=logging.CRITICAL,
            )
    except ValueError as error:
        raise InputError(f"--memory {crew.memory}: {error}") from error
    except RuntimeError as error:
        if starts > 1:
            return _local_cluster(crew, starts - 1)
        raise InputError(
            f"the workers could not be started ({error}): give the same command again"
        ) from error


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Ctrl-C reaches every process of a terminal.

    Those started here, and by threads that begin here, leave it to this one.
    """
    # a process of multiprocessing's own; the thread that starts it gets its signals back
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def dashboard(client: Client) -> str:
    """Return the address of Dask's dashboard, or ""."""
    return str(client.dashboard_link or "")


def run_jobs(
    client: Client,
    jobs: Iterator[ImageJob],
    tick: Callable[[], None],
    task: Callable[[ImageJob], ImageOutcome] = process,
) -> Iterator[tuple[ImageJob, ImageOutcome]]:
    """Run every job and yield it with its outcome, in order of completion.

    Parameters
    ----------
    client : dask.distributed.Client
    jobs : iterator of ImageJob
    tick : callable
        Called several times a second; an exception from it ends the work.
    task : callable
        What a worker does with a job.

    Returns
    -------
    iterator of (ImageJob, ImageOutcome)

    Raises
    ------
    InputError
        If the scheduler, or all workers, are lost.
    """
    ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
    waiting: dict[str, tuple[ImageJob, Any]] = {}
    workforce, more = _Workforce(client), True
    while more or waiting:
        tick()
        workforce.look()
        while more and len(waiting) < workforce.window:
            if (job := next(jobs, None)) is None:
                more = False
                break
            key = f"isc-{job.plan.run}-{job.number}"
            future = client.submit(task, job, key=key, pure=False, retries=0)
            waiting[key] = job, future
            future.add_done_callback(ended.put)
        for future in _some(ended):
            if future.status in (
                "pending",
                "lost",
            ):  # its worker died before it told; another does it again
                future.add_done_callback(ended.put)
                continue
            job, _ = waiting.pop(future.key)
            outcome = _outcome(future)
            future.release()
            yield job, outcome


class _Workforce:
    """Looks after the workers: how many jobs they can be given at a time, and whether there are
    any.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._wanted = 0 if client.cluster is None else len(client.cluster.workers)
        self._looked, self._seen = float("-inf"), time.monotonic()
        self.window = _AHEAD

    def look(self) -> None:
        """Every few seconds: has workers of this machine that were given up started again.

        Raises `InputError` where all is lost.
        """
        if (now := time.monotonic()) - self._looked < _LOOK_SECONDS:
            return
        self._looked = now
        if self._client.status != "running":
            raise InputError(_LOST)
        there = len(self._client.scheduler_info(n_workers=-1)["workers"])
        if self._wanted:
            self._client.cluster.scale(self._wanted)
        if there:
            self._seen = now
        elif now - self._seen > _LONELY_SECONDS:
            raise InputError(
                f"there was no worker for {_LONELY_SECONDS:.0f} s: start some, and give the same "
                "command again"
            )
        self.window = _AHEAD * max(1, there, self._wanted)


def _some(ended: "queue.SimpleQueue[Any]") -> Iterator[Any]:
    """What has ended; waits a moment where nothing has."""
    try:
        yield ended.get(timeout=_DEAL_SECONDS)
        while True:
            yield ended.get_nowait()
    except queue.Empty:
        return


def _outcome(future: Any) -> ImageOutcome:
    from dask.distributed import KilledWorker

    if future.status == "finished":
        outcome: ImageOutcome = future.result()
        return outcome
    if future.status != "error":
        raise InputError(_LOST)
    error = future.exception()
    if isinstance(error, KilledWorker):
        return ImageOutcome(
            FAILED,
            "workers were lost while they run_jobs on it: it may need more memory than they have",
        )
    text = re.sub(r"\s+", " ", str(error))
    return ImageOutcome(
        FAILED, f"a fault of this program, please report it: {type(error).__name__}: {text}"
    )
