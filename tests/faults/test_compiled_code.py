"""Compiled code that is kept between runs may be cut short, like any file: the next run does
without it.
"""

import os
import pickle
from pathlib import Path

from isc_core.numerics.jit import drop_broken


def test_kept_code_that_was_cut_short_is_dropped(tmp_path: Path) -> None:
    """An empty index, which a loss of power leaves, ended every later run with a traceback of
    Numba's.
    """
    content = pickle.dumps("0.60") + pickle.dumps(((1.0, 2), {"signature": b"code" * 100}))
    for name in ("whole.nbi", "whole.1.nbc", "empty.nbi", "short.1.nbc", "letter.txt"):
        (tmp_path / name).write_bytes(content)
    os.truncate(tmp_path / "empty.nbi", 0)
    os.truncate(tmp_path / "short.1.nbc", len(content) // 2)
    os.truncate(tmp_path / "letter.txt", 0)
    drop_broken(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "letter.txt",
        "whole.1.nbc",
        "whole.nbi",
    ]
    drop_broken(tmp_path / "nowhere")
