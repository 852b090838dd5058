"""Hypothesis profiles: `default` for the normal test run, `campaign` for long runs.

Choose one with `ISC_TEST_PROFILE=campaign` or `pytest tests/properties
--hypothesis-profile=campaign`.
"""

import os

from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "default",
    max_examples=25,
    deadline=None,
    database=None,
    derandomize=True,
    phases=(Phase.generate, Phase.target),
    report_multiple_bugs=False,
    suppress_health_check=list(HealthCheck),
)
settings.register_profile(
    "campaign",
    settings.get_profile("default"),
    max_examples=10_000,
    derandomize=False,
    phases=(Phase.generate, Phase.target, Phase.shrink),
)
settings.load_profile(os.environ.get("ISC_TEST_PROFILE", "default"))
