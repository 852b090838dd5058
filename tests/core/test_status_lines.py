"""What a result's status says to people."""

from isc_core.result_files.status_lines import status_lines


def test_everything_that_is_to_be_said_is_a_line() -> None:
    status = {
        "converged": False,
        "help": "a",
        "gloss": "b",
        "light_colour": {"help": "c"},
        "doubts": ["d", "e"],
    }
    assert status_lines(status) == ["note: a", "gloss: b", "note: c", "note: d", "note: e"]
    assert status_lines(
        {**status, "converged": True, "light_colour": {"help": ""}, "doubts": []}
    ) == ["gloss: b"]
    assert status_lines({}) == []


def test_somebody_elses_file_does_no_harm() -> None:
    assert (
        status_lines({"converged": False, "gloss": 3, "light_colour": "red", "doubts": {"a": 1}})
        == []
    )
    assert status_lines({"doubts": [1, None, "two lamps"]}) == ["note: two lamps"]
