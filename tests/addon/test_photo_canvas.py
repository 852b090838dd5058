"""Clicks and strokes on the photo: what they mark, and what ends them."""

from collections.abc import Sequence
from math import hypot
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="needs the extra `blender`")

from blender_addon.operators.mask import ISC_OT_draw_box  # noqa: E402 (after the skip)
from blender_addon.operators.photo_operators import (  # noqa: E402
    ClickOnPhoto,
    PhotoOperator,
    StrokeOnPhoto,
    points_along,
)

SIZE = (200, 100)


class OnPhoto(PhotoOperator):
    """On a photo of 200 x 100 pixels that fills its region."""

    def __init__(self) -> None:
        self.taken: list[str] = []
        self.reports: list[str] = []
        self._size = SIZE
        self._canvas: Any = SimpleNamespace(
            position=lambda event: event.position,
            place=lambda position: (position[0] / SIZE[0], position[1] / SIZE[1]),
            redraw=lambda: None,
            close=lambda: None,
        )

    def report(self, kind: set[str], text: str) -> None:
        self.reports.append(text)

    def follow(self, *events: tuple[str, str, tuple[int, int] | None]) -> list[set[str]]:
        context = SimpleNamespace(window=None, scene=SimpleNamespace(isc=None))
        return [
            self.modal(context, SimpleNamespace(type=kind, value=value, position=position))
            for kind, value, position in events
        ]


class Stroke(OnPhoto, StrokeOnPhoto):
    """Marks points."""

    def use_points(self, settings: Any, points: Sequence[str]) -> None:
        self.taken += points


class Click(OnPhoto, ClickOnPhoto):
    """Marks a point."""

    def use_point(self, settings: Any, point: str) -> None:
        self.taken.append(point)


def test_a_click_is_one_point() -> None:
    stroke = Stroke()
    ended = stroke.follow(
        ("MOUSEMOVE", "NOTHING", (3, 3)),
        ("LEFTMOUSE", "PRESS", (40, 20)),
        ("LEFTMOUSE", "RELEASE", (40, 20)),
    )
    assert ended == [{"PASS_THROUGH"}, {"RUNNING_MODAL"}, {"FINISHED"}]
    assert stroke.taken == ["40,80"], "row 0 is at the top"


def test_a_stroke_is_some_points_along_it_and_none_beside_the_photo() -> None:
    stroke = Stroke()
    moves = [("MOUSEMOVE", "NOTHING", (x, 50)) for x in range(20, 300, 3)]
    ended = stroke.follow(
        ("LEFTMOUSE", "PRESS", (20, 50)), *moves, ("LEFTMOUSE", "RELEASE", (300, 50))
    )
    assert ended[-1] == {"FINISHED"} and set(map(str, ended[:-1])) == {"{'RUNNING_MODAL'}"}
    columns = [int(point.split(",")[0]) for point in stroke.taken]
    assert len(columns) == 8 and (columns[0], columns[-1]) == (20, 197)
    assert np.ptp(np.diff(columns)) <= 1


@pytest.mark.parametrize(
    ("events", "reports"),
    [
        ([("LEFTMOUSE", "PRESS", (5, 5)), ("ESC", "PRESS", (5, 5))], 0),
        ([("RIGHTMOUSE", "PRESS", (5, 5))], 0),
        ([("LEFTMOUSE", "PRESS", None)], 0),  # the region is gone
        ([("LEFTMOUSE", "PRESS", (-5, 5)), ("LEFTMOUSE", "RELEASE", (-9, 5))], 1),
    ],
)
def test_what_ends_a_stroke_without_points(
    events: list[tuple[str, str, tuple[int, int] | None]], reports: int
) -> None:
    stroke = Stroke()
    assert stroke.follow(*events)[-1] == {"CANCELLED"}
    assert not stroke.taken and len(stroke.reports) == reports and stroke._canvas is None


@pytest.mark.parametrize(
    ("event", "reports"),
    [
        (("ESC", "PRESS", (5, 5)), 0),
        (("RIGHTMOUSE", "PRESS", (5, 5)), 0),
        (("MOUSEMOVE", "NOTHING", None), 0),  # the region is gone
        (("LEFTMOUSE", "PRESS", (-5, 5)), 1),
    ],
)
def test_what_ends_a_click_without_a_point(
    event: tuple[str, str, tuple[int, int] | None], reports: int
) -> None:
    click = Click()
    assert click.follow(event) == [{"CANCELLED"}]
    assert not click.taken and len(click.reports) == reports and click._canvas is None


def test_a_pressed_button_is_a_click_and_other_events_pass() -> None:
    click = Click()
    ended = click.follow(("MOUSEMOVE", "NOTHING", (3, 3)), ("LEFTMOUSE", "PRESS", (40, 20)))
    assert ended == [{"PASS_THROUGH"}, {"FINISHED"}]
    assert click.taken == ["40,80"] and not click.reports


@pytest.mark.parametrize("seed", range(3))
def test_points_are_few_apart_and_on_the_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = [(int(x), int(y)) for x, y in np.cumsum(rng.integers(-1, 4, (300, 2)), 0)]
    chosen = points_along(path, (1000, 1000))
    away = [min(hypot(a[0] - b[0], a[1] - b[1]) for b in path) for a in chosen]
    assert max(away) < 3 and (chosen[0], chosen[-1]) == (path[0], path[-1]) and len(chosen) == 8
    assert all(hypot(a[0] - b[0], a[1] - b[1]) > 5 for a in chosen for b in chosen if a != b)
    assert points_along([], SIZE) == [] and points_along([(3, 4)] * 5, SIZE) == [(3, 4)]


def test_a_fast_stroke_has_points_between_its_events() -> None:
    assert points_along([(0, 0), (70, 0)], (100, 100)) == [(10 * k, 0) for k in range(8)]
    assert points_along([(0, 0), (3, 0)], (100, 100)) == [(0, 0), (3, 0)]
    assert points_along([(0, 0), (1, 0)], (100, 100)) == [(0, 0)]


def test_a_box_is_drawn_between_both_ends_of_the_path() -> None:
    corners = ISC_OT_draw_box.outline(None, [(3, 4), (90, 1), (7, 9)])
    assert corners == [(3, 4), (7, 4), (7, 9), (3, 9), (3, 4)]
