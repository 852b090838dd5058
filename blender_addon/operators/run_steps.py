"""What workers are asked to do, as scripts for `run.Run`: decompose a photo, cut a mask out of a
box, complete a result's arrays.
"""

from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from ..files.image_export import Picture, hand_over, hand_over_mask
from ..files.result_arrays import ARRAYS
from ..worker.process import Job, Update, Worker, WorkerEnvironment, box_mask, start, start_arrays
from .messages import in_words, notes_of
from .request import Method
from .worker_run import Made, Script, WorkFailed, during, follow

_HANDING_OVER = "handing the photo over"
RESULT = "result"


def decompose(
    photo: Picture,
    mask: Picture | None,
    mask_size: tuple[int, int] | None,
    method: Method,
    folder: Path,
    threads: int,
    environment: WorkerEnvironment,
) -> Script:
    """Decomposes a photo into the folder `RESULT` within the run's own `folder`; returns that one,
    its arrays included.
    """
    photo_path = yield from during(_HANDING_OVER, hand_over(photo, folder / "photo"))
    mask_path = None
    if mask is not None:
        mask_path = yield from during(
            _HANDING_OVER, hand_over_mask(mask, folder / "mask", mask_size)
        )
    job = Job(
        photo=photo_path,
        output=folder / RESULT,
        mask=mask_path,
        model=method.model,
        separator=method.separator,
        illumination=method.illumination,
        max_size=method.max_size,
        threads=threads,
        transfer=photo.transfer,
    )
    names = {str(photo_path): photo.name} | ({} if mask is None else {str(mask_path): mask.name})
    done = yield from _worked(lambda: start(job, environment), names)
    for handed in (photo_path, mask_path):
        # What was handed over has served; a file of the user's own is not in the run's folder.
        if handed is not None and handed.parent == folder:
            handed.unlink(missing_ok=True)
    return Made(folder / RESULT, notes_of(done.message))


def cut_out(
    photo: Picture, box: tuple[int, int, int, int], folder: Path, environment: WorkerEnvironment
) -> Script:
    """Cuts the object inside `box` (left, top, width, height in pixels) out of a photo; returns the
    mask's PNG.
    """
    path = yield from during(_HANDING_OVER, hand_over(photo, folder / "photo"))
    mask = folder / "mask.png"
    yield from _worked(
        lambda: box_mask(path, box, mask, environment, photo.transfer), {str(path): photo.name}
    )
    return Made(mask)


def complete(result: Path, environment: WorkerEnvironment) -> Script:
    """Adds the arrays that Blender reads to a result folder that was made without them; returns it."""
    if not (result / ARRAYS).is_file():
        yield from _worked(lambda: start_arrays(result, environment), {})
    return Made(result)


def _worked(
    begin: Callable[[], Worker], names: Mapping[str, str]
) -> Generator[Update, None, Update]:
    """Starts a worker and follows it to its end; what it says is said in the window's words.

    `names`: of images, by path.
    """
    worker = yield from _begun(begin)
    try:
        return (yield from follow(worker))
    except WorkFailed as failure:
        raise WorkFailed(in_words(str(failure), names), failure.report) from failure


def _begun(begin: Callable[[], Worker]) -> Generator[Update, None, Worker]:
    """Starts a worker in a thread: on a busy machine a new process of a large program takes longer
    than a window may wait.
    """
    pool = ThreadPoolExecutor(1)
    starting = pool.submit(begin)
    pool.shutdown(wait=False)
    followed = False
    try:
        yield Update("starting the worker")
        while not starting.done():
            yield Update("starting the worker")
        followed = True
        return starting.result()
    finally:
        if not followed:  # cancelled meanwhile
            starting.add_done_callback(_end_unfollowed)


def _end_unfollowed(started: Future[Worker]) -> None:
    if started.exception() is None:
        started.result().kill()
