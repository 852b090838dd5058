"""What the user of a benchmark got wrong is one line, and exit code 2."""

import pytest

from benchmarks.program import run_program
from isc_core.errors import InputError


def test_a_users_error_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    def refused() -> None:
        raise InputError("x is no set: give another folder")

    with pytest.raises(SystemExit) as found:
        run_program(refused)
    assert found.value.code == 2
    assert capsys.readouterr().err == "error: x is no set: give another folder\n"


@pytest.mark.parametrize("code", [None, 0, 1])
def test_the_exit_code_is_that_of_the_program(code: int | None) -> None:
    with pytest.raises(SystemExit) as found:
        run_program(lambda: code)
    assert found.value.code == code
