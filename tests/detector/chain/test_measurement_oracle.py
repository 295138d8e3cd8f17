"""Returns laid out over the focal plane, against the reference, and the whole measurement."""

from dataclasses import fields

import numpy as np
import pytest

from rso_lidar.detector import Gsfl, detect
from rso_lidar.detector.chain import measurement
from rso_lidar.detector.chain.camera import camera_of
from rso_lidar.detector.chain.full import store_waveforms
from rso_lidar.detector.chain.measurement import measure
from rso_lidar.detector.ranging import location
from tests.detector.returns_for_tests import nothing, returns
from tests.reference.detector import fitting as fitting_reference
from tests.reference.detector import report as report_reference

N = 600


def photons():
    """Return two surfaces, from 4 to 60 m apart, in each of N pixels, with light from none to more than full scale."""
    rng = np.random.default_rng(1)
    near = rng.uniform(900.0, 1000.0, N)
    range_m = np.stack([near, near + rng.uniform(4.0, 60.0, N)], axis=1).ravel()
    light = 10.0 ** rng.uniform(1.0, 4.8, 2 * N)
    return returns(range_m, light, pixel=np.repeat(np.arange(N), 2), shape=(20, N // 20))


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"returns": "strongest"},
        {"returns": "last", "max_returns": 4},
        {"max_returns": 2, "maps": {"calibrated": True}},
        {"saturation": {}, "ranging": {"algorithm": "leading_edge", "walk_correction": True}},
        {"gate": {"delay_ns": 5900.0, "width_ns": 900.0, "pulses": 2}, "returns": "strongest", "max_returns": 8},
    ],
)
@pytest.mark.parametrize("light", [True, False])
def test_the_reference_reads_the_same(settings, light, monkeypatch):
    """A float32 of range, 6e-5 m in 1 km; of several pulses 1e-4 of a sample, 4e-5 m; counts to 1, where they are halves."""
    gsfl = Gsfl(**settings)
    lit = photons() if light else nothing((20, N // 20))
    camera = camera_of(gsfl, lit)
    waveforms = store_waveforms(camera, lit, np.random.default_rng(2))[0]
    one = measure(camera.processor, waveforms, np.random.default_rng(3))
    monkeypatch.setattr(location, "fit_first_pulses", fitting_reference.fit_first_pulses)
    monkeypatch.setattr(location, "fit_all_pulses", fitting_reference.fit_all_pulses)
    monkeypatch.setattr(measurement, "report_traces", report_reference.report_traces)
    other = measure(camera.processor, waveforms, np.random.default_rng(3))
    assert not light or np.isfinite(one.range_m).mean() > 0.3
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if a is None:
            assert b is None
            continue
        assert a.dtype == b.dtype and a.shape == b.shape
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1.0 if a.dtype == np.uint16 else 1e-4, equal_nan=True)


def test_the_loop_compiles_once():
    for gsfl in (Gsfl(), Gsfl(max_returns=3), Gsfl(gate={"delay_ns": 5900.0, "width_ns": 900.0})):
        detect(photons(), gsfl, np.random.default_rng(4))
    assert len(measurement.report_traces.dispatcher.signatures) == 1
