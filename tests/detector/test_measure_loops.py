"""Returns laid out over the focal plane, compiled against NumPy, and the whole measurement on both paths."""

from dataclasses import fields

import numpy as np
import pytest

from rso_lidar import arithmetic
from rso_lidar.detector.gsfl import Gsfl
from rso_lidar.detector.measure import measure
from tests.detector.returns_for_tests import nothing, returns

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
def test_both_paths_read_the_same(settings, light):
    """A float32 of range, 6e-5 m in 1 km; of several pulses 1e-4 of a sample, 4e-5 m; counts to 1, where they are halves."""
    gsfl = Gsfl(**settings)
    lit = photons() if light else nothing((20, N // 20))
    waveforms, found = gsfl.waveforms(lit, np.random.default_rng(2)), []
    for path in ("numpy", "numba"):
        with arithmetic.using(path):
            found.append(measure(gsfl, waveforms, gsfl.pulse(lit), np.random.default_rng(3)))
    one, other = found
    assert not light or np.isfinite(one.range_m).mean() > 0.3
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if a is None:
            assert b is None
            continue
        assert a.dtype == b.dtype and a.shape == b.shape
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1.0 if a.dtype == np.uint16 else 1e-4, equal_nan=True)


def test_the_loop_compiles_once():
    from rso_lidar.detector.measure_loops import lay_out

    with arithmetic.using("numba"):
        for gsfl in (Gsfl(), Gsfl(max_returns=3), Gsfl(gate={"delay_ns": 5900.0, "width_ns": 900.0})):
            gsfl.detect(photons(), np.random.default_rng(4))
    assert len(lay_out.signatures) == 1
