"""Output that native libraries print is muted, and only as long as they run."""

import os
import sys
import warnings

import pytest

from isc_core.io.native_io import suppress_native_output


def test_overlapping_blocks_mute_until_the_last_ends(capfd: pytest.CaptureFixture[str]) -> None:
    """As in two threads that read files: neither block lies within the other."""
    first, second = suppress_native_output(), suppress_native_output()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    print("muted")
    os.write(2, b"muted\n")
    second.__exit__(None, None, None)
    print("shown")
    print("problem", file=sys.stderr)
    os.write(2, b"also\n")
    with pytest.warns(UserWarning, match="seen"):
        warnings.warn("seen", stacklevel=1)
    assert capfd.readouterr() == ("shown\n", "problem\nalso\n")
