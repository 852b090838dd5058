"""Where `make kernels` keeps libraries, under a digest of all that they are made from.

Tests use these instead of compiling the same kernels again, half a minute each time.
"""

from pathlib import Path

KEPT = Path(__file__).resolve().parents[3] / "build" / "wheels" / "kernels"
