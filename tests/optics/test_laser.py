import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.optics import Laser

# SI, 2019: h and c are exact. Written out here, so that a slip in units.py shows.
PHOTON_J = 6.62607015e-34 * 299792458.0 / 1064e-9


def test_photons_of_a_pulse():
    assert Laser().photons == pytest.approx(0.050 / PHOTON_J, rel=1e-12)
    assert Laser().photons == pytest.approx(2.678e17, rel=2e-4)  # four digits, as the design notes give it
    assert Laser(wavelength_nm=1570).photons / Laser().photons == pytest.approx(1570 / 1064, rel=1e-12)


@pytest.mark.parametrize("divergence_deg", [0.05, 2.5, 45.0, 120.0])
@pytest.mark.parametrize(("footprint", "sent"), [("square", 1), ("circle", 1), ("gaussian", 1), ("as_printed", 4)])
def test_density_integrates_to_the_energy_sent(footprint, sent, divergence_deg):
    """Summed in rings and squares by hand: eq. 7 as printed sends four times the energy."""
    laser = Laser(divergence_deg=divergence_deg, footprint=footprint)
    t = math.tan(math.radians(divergence_deg) / 2)
    reach = 6 * t if footprint == "gaussian" else t  # a Gaussian has exp(-72) of itself left beyond
    n = 1000
    middle = (np.arange(n) + 0.5) / n
    if footprint in ("square", "as_printed"):
        x = (2 * middle - 1) * reach
        total = laser.density(x[:, None], x[None, :]).sum() * (2 * reach / n) ** 2
    else:
        r = middle * reach
        total = np.sum(laser.density(r * 0.6, r * 0.8) * 2 * math.pi * r) * reach / n
    assert total / laser.photons == pytest.approx(sent, rel=1e-5)


@pytest.mark.parametrize("footprint", ["square", "circle", "as_printed"])
def test_nothing_is_lit_beyond_the_edge(footprint):
    laser = Laser(footprint=footprint)
    t = math.tan(math.radians(1.25))
    x = np.array([0.0, 0.999 * t, -0.999 * t, 1.001 * t, 0.0, 0.999 * t])
    y = np.array([0.0, 0.0, 0.0, 0.0, -1.001 * t, 0.999 * t])
    lit = [True, True, True, False, False, footprint != "circle"]
    assert laser.is_lit(x, y).tolist() == lit
    assert (laser.density(x, y) > 0).tolist() == lit


def test_gaussian_falls_to_1_over_e2_at_half_the_divergence():
    laser = Laser(footprint="gaussian", divergence_deg=10)
    t = math.tan(math.radians(5))
    assert laser.density(0.6 * t, 0.8 * t) / laser.density(0.0, 0.0) == pytest.approx(math.exp(-2), rel=1e-12)


@pytest.mark.parametrize(
    "bad",
    [
        {"wavelength_nm": 0.0},
        {"energy_mj": -1.0},
        {"divergence_deg": 180.0},
        {"divergence_deg": 0.0},
        {"footprint": "ring"},
        {"pulse_fwhm_ns": float("nan")},
        {"energy_mj": float("inf")},
        {"energy_j": 0.05},
    ],
)
def test_a_laser_that_cannot_be(bad):
    with pytest.raises(ScenarioError) as caught:
        Laser(**bad)
    assert next(iter(bad)) in str(caught.value)
    assert "\n" not in str(caught.value)


# ------------------------------------------------------------------------------------------------------ pulses in time


def pulse_of(laser):
    """Return times about the pulse's middle [s], its power [1/s], and the step [s]."""
    step_s, power = laser.pulse
    return (np.arange(len(power)) - len(power) // 2) * step_s, power, step_s


def width_at_half(time, power):
    """Return the full width at half maximum [s], by straight lines between taps."""
    half = 0.5 * power.max()
    above = np.flatnonzero(power >= half)
    a, b = above[0], above[-1]
    left = np.interp(half, power[a - 1 : a + 1], time[a - 1 : a + 1])
    right = np.interp(half, power[[b + 1, b]], time[[b + 1, b]])
    return right - left


@pytest.mark.parametrize("fwhm_ns", [0.5, 6.0, 8.0, 10.0])
@pytest.mark.parametrize(
    "shape", [{}, *({"pulse_shape": "super_gaussian", "pulse_order": p} for p in (1.0, 2.0, 3.5, 20.0))]
)
def test_a_pulse_has_its_energy_and_its_width(shape, fwhm_ns):
    """Area 1, full width at half maximum as said (to the tap at order 20, whose flanks are steep), even in time."""
    laser = Laser(pulse_fwhm_ns=fwhm_ns, **shape)
    time, power, step_s = pulse_of(laser)
    assert power.sum() * step_s == pytest.approx(1, rel=1e-12)
    assert width_at_half(time, power) == pytest.approx(
        fwhm_ns * 1e-9, rel=2e-3 if shape.get("pulse_order") != 20 else 0.02
    )
    assert laser.pulse_fwhm_s == pytest.approx(fwhm_ns * 1e-9, rel=1e-15)
    assert np.array_equal(power, power[::-1]) and power[len(power) // 2] == power.max()
    assert power[[0, -1]].max() < 1e-15 * power.max()
    assert not power.flags.writeable


def test_super_gaussian_of_order_one_is_the_gaussian():
    gaussian, other = Laser(), Laser(pulse_shape="super_gaussian", pulse_order=1.0)
    assert np.array_equal(gaussian.pulse[1], other.pulse[1]) and gaussian.pulse[0] == other.pulse[0]
    assert not np.array_equal(gaussian.pulse[1], Laser(pulse_shape="super_gaussian").pulse[1])
    time, power, step_s = pulse_of(gaussian)
    s = 8e-9 / math.sqrt(8 * math.log(2))
    assert power == pytest.approx(np.exp(-0.5 * (time / s) ** 2) / (s * math.sqrt(2 * math.pi)), rel=1e-9)
    assert np.sum(power * time**2) * step_s == pytest.approx(s**2, rel=1e-9)


@pytest.mark.parametrize("order", [1.5, 2.0, 4.0])
def test_the_variance_of_a_super_gaussian(order):
    """Of exp(-|t/a|^2p): a² Γ(3/2p) / Γ(1/2p), with a = FWHM / (2 (ln 2)^(1/2p))."""
    time, power, step_s = pulse_of(Laser(pulse_shape="super_gaussian", pulse_order=order))
    a = 4e-9 / math.log(2) ** (0.5 / order)
    expected = a**2 * math.gamma(1.5 / order) / math.gamma(0.5 / order)
    assert np.sum(power * time**2) * step_s == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"pulse_shape": "measured"}, "pulse_file"),
        ({"pulse_file": "p.csv"}, "pulse_shape"),
        ({"footprint": "pattern"}, "pattern_file"),
        ({"pattern_file": "p.png"}, "footprint"),
        ({"pulse_shape": "super_gaussian", "pulse_order": 0.5}, "pulse_order"),
        ({"pulse_shape": "super_gaussian", "pulse_order": 21.0}, "pulse_order"),
        ({"energy_jitter_fraction": 0.6}, "energy_jitter_fraction"),
        ({"timing_jitter_ns": -1.0}, "timing_jitter_ns"),
        ({"offset_m": (0.0, 0.0)}, "offset_m"),
    ],
)
def test_settings_that_do_not_go_together(settings, word):
    with pytest.raises(ScenarioError, match=word) as caught:
        Laser(**settings)
    assert "\n" not in str(caught.value)


# -------------------------------------------------------------------------------------------------- from pulse to pulse


def test_jitter_has_the_spread_it_says():
    """4000 pulses: mean within 4 standard errors, standard deviation within 4 of its own (1/√2N), fixed seed."""
    laser = Laser(energy_jitter_fraction=0.03, timing_jitter_ns=0.5, energy_mj=20.0)
    rng = np.random.default_rng(8)
    n = 4000
    fired = [laser.fire(rng) for _ in range(n)]
    energy = np.array([one.energy_mj for one, _ in fired]) / 20.0 - 1.0
    late_s = np.array([late for _, late in fired])
    for values, sigma in ((energy, 0.03), (late_s, 0.5e-9)):
        assert values.mean() == pytest.approx(0, abs=4 * sigma / math.sqrt(n))
        assert values.std() == pytest.approx(sigma, rel=4 / math.sqrt(2 * n))
    assert abs(np.corrcoef(energy, late_s)[0, 1]) < 4 / math.sqrt(n)
    assert all(one.replace(energy_mj=20.0) == laser for one, _ in fired[:20])


def test_no_pulse_is_without_energy():
    laser = Laser(energy_jitter_fraction=0.5)
    rng = np.random.default_rng(3)
    assert min(laser.fire(rng)[0].energy_mj for _ in range(2000)) > 0


def test_a_steady_laser_draws_nothing():
    """The default must leave the generator where it was, or every frame's noise would change."""
    rng, untouched = (np.random.default_rng(5) for _ in range(2))
    laser = Laser()
    assert laser.fire(rng) == (laser, 0.0)
    assert rng.standard_normal() == untouched.standard_normal()


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (-0.0, 0.0, 0.0)])
def test_a_laser_in_the_lens_has_no_offset(offset):
    assert Laser(offset_m=offset).offset is None
    assert Laser(offset_m=(0.0, 0.1, 0.0)).offset.tolist() == [0.0, 0.1, 0.0]


def test_each_pulse_of_a_frame_is_fired_by_itself():
    """Energies over their mean and delays beyond it: with the mean they are the pulses' own, with the spread of each."""
    laser = Laser(energy_jitter_fraction=0.03, timing_jitter_ns=0.5, energy_mj=20.0)
    n = 4000
    mean, late_s, (energy, beyond_s) = laser.fire_pulses(np.random.default_rng(8), n)
    assert (energy.mean(), beyond_s.mean()) == (pytest.approx(1.0, rel=1e-12), pytest.approx(0.0, abs=1e-20))
    own, own_s = mean.energy_mj / 20.0 * energy - 1.0, late_s + beyond_s
    for values, sigma in ((own, 0.03), (own_s, 0.5e-9)):
        assert values.mean() == pytest.approx(0, abs=4 * sigma / math.sqrt(n)) and values.mean() != 0.0
        assert values.std() == pytest.approx(sigma, rel=4 / math.sqrt(2 * n))
    one, steady = (part.fire_pulses(np.random.default_rng(8), pulses) for part, pulses in ((laser, 1), (Laser(), 9)))
    assert one == (*laser.fire(np.random.default_rng(8)), None)
    assert steady == (Laser(), 0.0, None)
