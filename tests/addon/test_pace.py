"""Progress in time."""

import pytest

from blender_addon.runs.messages import stage_text
from blender_addon.worker.pace import Pace
from blender_addon.worker.process import WorkerUpdate


@pytest.mark.parametrize("size", [0, 64, 256, 512, 1024, 2048, 8192])
def test_the_share_grows_from_nothing_to_all(size: int) -> None:
    pace = Pace(size)
    shares = [pace.at(WorkerUpdate("x", n / 200), n / 10).fraction for n in range(201)]
    assert shares[0] == 0 and shares[-1] == pytest.approx(1)
    assert all(a <= b for a, b in zip(shares, shares[1:], strict=False))


def test_a_fraction_that_falls_does_not_move_the_bar_back() -> None:
    pace = Pace(512)
    first = pace.at(WorkerUpdate("x", 0.5), 3.0).fraction
    assert pace.at(WorkerUpdate("x", 0.1), 3.5).fraction == first


def test_the_time_left_follows_the_machine() -> None:
    """A machine of half the speed needs twice the time, and the end is at hand in the end."""
    quick, slow = (Pace(1024).at(WorkerUpdate("x", 0.8), seconds) for seconds in (15.0, 30.0))
    assert quick.seconds_left and slow.seconds_left == pytest.approx(2 * quick.seconds_left)
    assert Pace(1024).at(WorkerUpdate("x", 1.0), 20.0).seconds_left == pytest.approx(0)


def test_the_bar_moves_while_a_stage_reports_nothing() -> None:
    pace = Pace(512)
    shares = [pace.at(WorkerUpdate("x", 0.064), 4 + n / 10).fraction for n in range(600)]
    assert shares[10] > shares[0] and all(a <= b for a, b in zip(shares, shares[1:], strict=False))
    assert shares[-1] < pace.at(WorkerUpdate("x", 0.736), 64.0).fraction, "never past the stage"


def test_of_several_objects_the_share_is_that_of_all() -> None:
    """A worker that takes 20 s to find three objects and for each of them."""
    pace, told = Pace(512, several=True), []
    for step in range(161):
        elapsed, left = step / 2, 80 - step / 2
        update = WorkerUpdate("looking")
        if elapsed >= 20:
            number = min(int((elapsed - 20) / 20), 2) + 1
            update = WorkerUpdate("x", (elapsed - 20) / 60, part=(number, 3))
        shown = pace.at(update, elapsed)
        told.append((shown.fraction, shown.seconds_left, left))
    shares = [share for share, _, _ in told]
    assert shares[39] == 0 and told[39][1] is None, "how many there are is not known"
    assert all(a <= b for a, b in zip(shares, shares[1:], strict=False))
    assert shares[-1] == pytest.approx(1)
    for _, guess, true in told[80:]:
        assert guess is not None and abs(guess - true) < 0.4 * max(true, 20), (guess, true)


def test_nothing_is_said_at_the_start() -> None:
    assert Pace(512).at(WorkerUpdate("x", 0.0), 5.0).seconds_left is None
    assert Pace(512).at(WorkerUpdate("x", 0.5), 0.5).seconds_left is None


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (None, "shape"),
        (0.0, "shape, about 5 s left"),
        (22.0, "shape, about 20 s left"),
        (200.0, "shape, about 3 min left"),
    ],
)
def test_the_time_left_is_written_in_round_numbers(seconds: float | None, text: str) -> None:
    assert stage_text("shape", seconds) == text
    assert stage_text("object 2 of 3: shape", seconds) == f"2/3: {text}"
