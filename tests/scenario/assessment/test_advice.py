"""What is allowed and probably not meant of an instrument gets one line; what is sound gets none."""

import math

import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.scenario import preview_mission

# The plate stands at 1000 m: 2 x 1000 m / c = 6671.3 ns after emission. It is 4 m wide, 2.83 m from middle to corner.
GATE = "lidar.detector.gate={{delay_ns={}, width_ns={}}}"


@pytest.fixture
def advice(text):
    """Return a function that gives the advice on the bench with some settings."""

    def lines(*settings, bench=text):
        found = rl.Scenario.loads(bench, settings=settings).advice()
        assert not any("\n" in line for line in found)
        return found

    return lines


def only(lines, *words):
    assert len(lines) == 1, lines
    for word in words:
        assert word in lines[0], (word, lines[0])


def test_the_bench_is_sound(advice):
    assert advice() == []


class TestGate:
    def test_one_that_contains_the_target(self, advice):
        assert advice(GATE.format(6640, 60)) == []  # 995.3 to 1004.3 m

    @pytest.mark.parametrize("delay_ns", [0, 6500, 6800, 60_000])
    def test_one_that_misses_it(self, advice, delay_ns):
        only(advice(GATE.format(delay_ns, 60)), "target plate", "misses it 100%", "gate.delay_ns", "6.671 ns a metre")

    @pytest.mark.parametrize(("delay_ns", "width_ns"), [(6671, 60)])
    def test_one_that_cuts_it(self, advice, delay_ns, width_ns):
        only(advice(GATE.format(delay_ns, width_ns)), "cannot contain it whole 90%", "1.2 m deep", "gate.width_ns")

    def test_one_that_is_planned_to_leave_it(self, advice):
        """Of ten frames, 0.2 s apart, the last four (1.2 to 1.8 s) have a gate that opens behind the target."""
        plan = 'lidar.schedule={time_s=[0, 1.1], gate_delay_ns=[6640, 6900], interpolation="step"}'
        only(advice(GATE.format(6640, 60), plan), "misses it 40%", "lidar.schedule")

    def test_one_that_is_planned_to_stay_with_it(self):
        """Two kilometres of approach: a gate of 40 m about the target's middle holds its 21 m all the way."""
        approach = ('lidar.detector={type="gsfl", gate={delay_ns=19880, width_ns=267}}', "time.frame_rate_hz=0.01")
        path = "examples/tdrs_approach.toml"
        still = rl.Scenario.load(path, approach)
        assert any("the range gate" in line and "misses it" in line for line in still.advice())
        seen = preview_mission(still)
        delay_ns = (seen.targets[0].range_m - 20.0) * 2e9 / 299_792_458
        plan = f"lidar.schedule={{time_s={seen.time_s.tolist()}, gate_delay_ns={delay_ns.tolist()}}}"
        assert rl.Scenario.load(path, (*approach, plan)).advice() == []


class TestWindow:
    @pytest.mark.parametrize("setting", ["lidar.detector.armed_to_m=900", "lidar.detector.armed_from_m=1100"])
    def test_a_target_outside_of_what_is_armed(self, advice, setting):
        only(advice(setting), "target plate", "leaves the armed window", "armed_from_m and armed_to_m")

    @pytest.mark.parametrize("setting", ['returns="strongest"', 'returns="last"', "max_returns=3"])
    def test_what_a_triggered_pixel_can_choose_from(self, advice, setting):
        """20 samples of 2.38 ns are 47.6 ns, two-way 7.1 m."""
        only(advice(f"lidar.detector.{setting}"), "7.1 m", "lidar.detector.gate")
        assert advice(f"lidar.detector.{setting}", GATE.format(6640, 60)) == []


class TestThreshold:
    def low(self, times):
        """Return a setting of the threshold at so many times the noise, whatever the presets' constants are."""
        return f"lidar.detector.trigger.threshold_electrons={times * rl.Gsfl().noise_electrons}"

    def test_a_low_one_says_how_many_pixels_trigger_themselves(self, advice):
        only(advice(self.low(5.0)), "noise triggers", "% of the pixels in every frame", "threshold_electrons")
        assert advice(self.low(7.0)) == []

    def test_under_a_gate_nothing_triggers(self, advice):
        assert advice(self.low(5.0), GATE.format(6640, 60)) == []

    def test_an_impossible_one_is_refused_with_the_rate_that_it_means(self, text):
        """Rice (1944): noise passes u sigma upward ν₀ exp(-u²/2) times a second; two poles τ have ν₀ = 1/(2π τ)."""
        with pytest.raises(
            ScenarioError, match=r"threshold_electrons: .* 1 times the noise .*times a second.*; raise"
        ) as error:
            rl.Scenario.loads(text, settings=(self.low(1.0), 'lidar.detector.apd.statistics="gaussian"'))
        rate = math.exp(-0.5) / (2.0 * math.pi * rl.Gsfl().amplifier.pole_s)
        assert f"a nominal pixel {rate:,.0f} times a second" in str(error.value) and "\n" not in str(error.value)

    def test_one_that_avalanches_alone_reach_is_refused(self, text):
        """At 15.4 times the noise Gaussian noise never triggers, and avalanches do 80,000 times a second."""
        avalanches = ('lidar.detector.preset="offset_limited"', "lidar.detector.apd={gain=40, dark_current_na=0.05}")
        with pytest.raises(
            ScenarioError, match=r"15 times the noise .* a nominal pixel 80,461 times a second, 2.68 times"
        ):
            rl.Scenario.loads(text, settings=avalanches)
        for bears in ("lidar.detector.armed_to_m=1500", 'lidar.detector.apd.statistics="gaussian"'):
            assert rl.Scenario.loads(text, settings=(*avalanches, bears))


class TestSun:
    def test_a_filter_without_a_sun(self, advice):
        only(advice("lidar.receiver.filter_width_nm=5"), "filter_width_nm", "no Sun", "world.sun_direction")

    def test_a_filter_with_one(self, advice):
        assert advice("lidar.receiver.filter_width_nm=5", "world.sun_direction=[0, 0, 1]") == []

    def test_an_orbit_has_one(self):
        settings = ("lidar.receiver.filter_width_nm=5", "time.duration_s=20")
        assert rl.Scenario.load("examples/tdrs_approach.toml", settings).advice() == []


class TestLaserAside:
    """At 1000 m half the footprint is tan(1.25 deg) x 1000 m = 21.8 m wide."""

    def test_near_enough(self, advice):
        assert advice("lidar.laser.offset_m=[0.3, 0, 0]") == []
        assert advice("lidar.laser.offset_m=[21, 21, 0]") == []  # a square footprint reaches its corners

    @pytest.mark.parametrize(
        "settings",
        [
            ("lidar.laser.offset_m=[22, 0, 0]",),
            ("lidar.laser.offset_m=[0, -22, 0]",),
            ("lidar.laser.offset_m=[0, 0, 1001]",),
            ("lidar.laser.offset_m=[21, 21, 0]", 'lidar.laser.footprint="circle"'),
        ],
    )
    def test_too_far(self, advice, settings):
        only(advice(*settings), "target plate", "passes beside the boresight", "offset_m")


def test_a_target_that_blinds(advice):
    only(advice("lidar.laser.energy_mj=50000"), "half of its pixels or more saturate", "energy_mj")
    # What is planned for the nearest approach counts, not the energy beside the plan.
    assert advice("lidar.laser.energy_mj=50000", "lidar.schedule={time_s=[0], energy_mj=[50]}") == []


def test_a_short_pulse_and_a_low_rail_blind_with_less_light(advice):
    """The median pixel has 67,000 photons. 8 ns saturate at 108,776, 4 ns at 63,320, and 8 ns on that rail at 54,000."""
    assert advice("lidar.laser.energy_mj=800") == []
    only(advice("lidar.laser.energy_mj=800", "lidar.laser.pulse_fwhm_ns=4"), "half of its pixels or more saturate")
    rail = "lidar.detector.saturation={rail_electrons=4e5}"
    only(advice("lidar.laser.energy_mj=800", rail), "half of its pixels or more saturate")


def test_a_psf_of_another_wavelength_is_told(advice, tmp_path):
    rows = "\n".join("\t".join(f"{1.0 if (r, c) == (2, 2) else 0.1:.4E}" for c in range(5)) for r in range(5))
    for um, told in (("1.0600 to 1.0680", 0), ("0.4861 to 0.6563", 1)):
        file = tmp_path / f"psf{told}.txt"
        head = f"Listing of HUYGENS PSF Data\n\n{um} µm at 0.0000 (deg).\nData spacing is 20.000 µm.\n"
        file.write_text(
            head + "Image grid size: 5 by 5\nCenter point is: 3, 3\n\nValues are relative intensity.\n\n" + rows
        )
        lines = advice(f'lidar.receiver.psf={{type="zemax_huygens", file="{file}"}}')
        assert len(lines) == told
        assert not told or "486 to 656 nm" in lines[0]


def test_sunlight_that_makes_noise_is_told(advice):
    """A filter of 10 nm lets the Sun add nothing to speak of, one of 1000 nm half the noise again; none without a Sun."""
    sun = 'world={axes="local", sun_direction=[-1, 0, 0]}'
    assert advice(sun, "lidar.receiver.filter_width_nm=10") == []
    only(advice(sun, "lidar.receiver.filter_width_nm=1000"), "sunlight", "filter_width_nm")


class TestStrongReturns:
    """A plate at 1000 m with 50 J: some 9 million photons, 90 times what the converter holds."""

    def test_options_are_named(self, advice):
        words = ("and the range of", "is off by decimetres", "readout.low_gain", "detector.zero_crossing", "samples")
        only(advice("lidar.laser.energy_mj=50000"), *words)

    def test_an_option_in_use_is_not(self, advice):
        (line,) = advice("lidar.laser.energy_mj=50000", "lidar.detector.zero_crossing={}")
        assert "readout.low_gain" in line and "zero_crossing" not in line and "decimetres" not in line
        assert advice("lidar.laser.energy_mj=30000", "lidar.detector.readout.low_gain={}") == []

    def test_an_amplifier_that_clips_before_the_first_channel(self, advice):
        settings = ("lidar.detector.readout.low_gain={}", "lidar.detector.saturation={}")
        only(advice(*settings), "the second is never needed", "saturation.rail_electrons")
