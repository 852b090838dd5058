"""Halves of the held-out bodies, on which weights are chosen and reported."""

from training.world.files import Split, half_of, split_of


def test_halves_of_held_out_bodies_are_about_equal() -> None:
    held_out = [
        name for k in range(8000) if split_of(name := f"built/box/{k}") is Split.UNSEEN_BODY
    ]
    assert 0.45 < sum(map(half_of, held_out)) / len(held_out) < 0.55


def test_parts_of_one_piece_of_furniture_lie_in_one_half() -> None:
    parts = [
        {half_of(f"furniture/Scopia/ext-table_{k}-{part}") for part in (0, 1, 12)}
        for k in "abcdefgh"
    ]
    assert all(len(halves) == 1 for halves in parts) and set.union(*parts) == {0, 1}
