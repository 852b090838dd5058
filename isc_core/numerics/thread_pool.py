"""A thread pool for kernels that release the interpreter lock.

Determinism: which thread runs which task never changes a result. Tasks write to disjoint memory,
and sums over tasks are taken in the order of the tasks.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache, wraps
from threading import RLock
from types import TracebackType
from typing import TypeVar, TypeVarTuple

Arguments = TypeVarTuple("Arguments")
Result = TypeVar("Result")


class ThreadPool:
    """Run lists of tasks on several threads, the calling one included.

    Use it as a context manager, or call `close`; else the threads end with the last reference.

    Parameters
    ----------
    threads : int
        Number of threads, at least 1.
    """

    def __init__(self, threads: int) -> None:
        self.threads = max(1, threads)
        self._pool = ThreadPoolExecutor(self.threads - 1) if self.threads > 1 else None

    def run(self, tasks: Sequence[Callable[[], None]]) -> None:
        """Run every task, and return, or raise, when none is running any more.

        Parameters
        ----------
        tasks : sequence of callable
            Called without arguments, in this order if there is one thread.

        Raises
        ------
        Exception
            The first exception of a task.
        """
        if self._pool is None or len(tasks) < 2:
            for task in tasks:
                task()
            return
        pending = iter(tasks)
        others = [
            self._pool.submit(_drain, pending) for _ in range(min(self.threads, len(tasks)) - 1)
        ]
        try:
            _drain(pending)
        finally:
            wait(others)  # they write to memory of the caller
        for other in others:
            other.result()

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()

    def __enter__(self) -> "ThreadPool":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _drain(pending: Iterator[Callable[[], None]]) -> None:
    for task in pending:  # a list's iterator yields each task to one thread only
        task()


def computed_once(
    function: Callable[[*Arguments], Result],
) -> Callable[[*Arguments], Result]:
    """Keep the results of a function; a thread that needs one being computed waits for it.

    With `functools.cache`, both threads would compute it. An exception is not kept.

    Parameters
    ----------
    function : callable
        Of hashable arguments.

    Returns
    -------
    callable
    """
    kept, lock = cache(function), RLock()

    @wraps(function)
    def waiting(*arguments: *Arguments) -> Result:
        with lock:
            return kept(*arguments)

    return waiting
