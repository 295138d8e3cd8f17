"""The chain with all its kernels replaced by their oracles, for tests that run the whole of it by both."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from rso_lidar.detector.chain import analog, full, measurement, traces
from rso_lidar.detector.ranging import location
from rso_lidar.detector.stages import avalanche, comparator, false_triggers, light, overlap
from tests.reference.detector import amplification as amplification_oracle
from tests.reference.detector import avalanche as avalanche_oracle
from tests.reference.detector import comparator as comparator_oracle
from tests.reference.detector import convolution as convolution_oracle
from tests.reference.detector import false_triggers as false_triggers_oracle
from tests.reference.detector import fitting as fitting_oracle
from tests.reference.detector import light as light_oracle
from tests.reference.detector import overlap as overlap_oracle
from tests.reference.detector import report as report_oracle
from tests.reference.detector import sampling as sampling_oracle
from tests.reference.detector import time_axis as time_axis_oracle

PATHS = ("kernels", "oracles")

_REPLACED = (
    (traces, "place_rows", time_axis_oracle),
    (analog, "spread_light", light_oracle),
    (light, "spread_light", light_oracle),
    (analog, "convolve_light", convolution_oracle),
    (analog, "multiply", avalanche_oracle),
    (avalanche, "multiply", avalanche_oracle),
    (analog, "amplify", amplification_oracle),
    (overlap, "copy_shared", overlap_oracle),
    (traces, "find_latches", comparator_oracle),
    (comparator, "find_latches", comparator_oracle),
    (traces, "refine_crossings", comparator_oracle),
    (traces, "store_samples", sampling_oracle),
    (full, "store_samples", sampling_oracle),
    (false_triggers, "draw_onward", false_triggers_oracle),
    (location, "fit_first_pulses", fitting_oracle),
    (location, "fit_all_pulses", fitting_oracle),
    (measurement, "report_traces", report_oracle),
)


@contextmanager
def computing(path: str) -> Iterator[None]:
    """Run what stands inside with the kernels, or with the oracles in their place."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name, oracle in _REPLACED if path == "oracles" else ():
            patch.setattr(module, name, getattr(oracle, name))
        yield
