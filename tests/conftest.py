"""Settings of every test: Hypothesis draws the same examples each time, and takes its time."""

from __future__ import annotations

from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "rps_pin",
    derandomize=True,
    deadline=None,
    max_examples=60,
    print_blob=True,
    phases=[Phase.explicit, Phase.generate, Phase.shrink],  # "explain" takes minutes
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("rps_pin")
