"""The description: some twenty lines that say what the instrument is, and what it would see."""

import math
import re

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.detector import make_plate, run_trial

ENVISAT = """
version = 1
name = "retro-reflectors"
time = { start_utc = 2024-01-01T00:00:00Z, duration_s = 1, frame_rate_hz = 1 }
world = { axes = "local" }
target = [{ name = "envisat", model = "envisat", motion = { type = "fixed", position_m = [3000, 0, 0] } }]
follower = { motion = { type = "fixed", position_m = [0, 0, 0] } }
lidar = { preset = "gsfl_1064" }
"""


@pytest.fixture
def described(text):
    """Return a function that gives the description of the bench with some settings, by the first word of its lines.

    The bench flies a single frame, unless the number of its frames is given.
    """

    def lines(*settings, bench=text, frames=1):
        length = f"time.duration_s={frames / 5}"
        lines = rl.Scenario.loads(bench, settings=(length, *settings)).describe().splitlines()
        assert len(lines) <= 30
        return {line.split()[0]: line for line in lines if line.strip()}

    return lines


def test_a_plain_instrument_has_no_lines_for_what_it_has_not(described):
    lines = described(frames=10)
    assert {"laser", "receiver", "detector", "trigger", "budget", "first", "last", "verdict"} <= set(lines)
    assert not {"beam", "lens", "schedule", "gate", "with"} & set(lines)


def test_the_detector_and_its_threshold(described):
    lines, gsfl = described(), rl.Gsfl()
    for words in ("gsfl noise_limited", "QE 0.8", "gain 10", "100 MHz", "20 samples of 2.38 ns", "matched_filter"):
        assert words in lines["detector"], words
    assert f"{gsfl.trigger.threshold_electrons:.0f} electrons" in lines["trigger"]
    assert f"{gsfl.threshold_over_noise:.1f} times the noise" in lines["trigger"]
    assert "armed 1 to 5000 m" in lines["trigger"]


@pytest.mark.parametrize("fwhm_ns", [2.5, pytest.param(16.0, marks=pytest.mark.slow)])
def test_the_light_that_is_detected_counts_the_length_of_the_pulse(described, fwhm_ns):
    """16,384 pixels see the photons of the line, and half and 95 % of them detect it, within 4 binomial sigma."""
    line = described(f"lidar.laser.pulse_fwhm_ns={fwhm_ns}")["detects"]
    assert line.endswith(f"in pulses of {fwhm_ns:g} ns")
    laser, n = rl.Laser(pulse_fwhm_ns=fwhm_ns), 16_384
    for share in (0.5, 0.95):
        photons = float(re.search(rf"{100 * share:.0f} % of the returns of ([\d,]+) photons", line)[1].replace(",", ""))
        light = make_plate(photons, n, laser.pulse, laser.pulse_fwhm_s)
        found = run_trial(rl.Gsfl(), light, np.random.default_rng(3)).probability
        # the closed form is normal where the amplitude is a gamma law at each instant; it is good to 0.005
        assert found == pytest.approx(share, abs=0.005 + 4.0 * math.sqrt(share * (1.0 - share) / n))


def test_the_gate(described):
    """6640 ns and 60 ns, two-way, are 995.31 m and 8.99 m."""
    lines = described("lidar.detector.gate={delay_ns=6640, width_ns=60, pulses=10}")
    assert "trigger" not in lines
    for words in ("995.3 to 1004.3 m", "10 pulses a frame", "false alarms 0.001"):
        assert words in lines["gate"], words


def test_the_fast_model(described):
    lines = described('lidar.detector.type="empirical"')
    assert "empirical" in lines["detector"]
    assert not {"trigger", "gate"} & set(lines)


BESIDES = [
    ('lidar.receiver.psf={type="airy"}', "lens", "PSF airy"),
    ('lidar.receiver.distortion={type="brown_conrady", k1=-1.0}', "lens", "distortion brown_conrady"),
    ("lidar.receiver.filter_width_nm=5", "lens", "filter 5 nm"),
    ("lidar.laser.offset_m=[0.3, 0.4, 0]", "beam", "0.5 m from the lens"),
    ("lidar.laser.energy_jitter_fraction=0.05", "beam", "jitter 0.05"),
    ('lidar.laser.pulse_shape="super_gaussian"', "beam", "super_gaussian"),
    ("lidar.schedule={time_s=[0, 2], energy_mj=[50, 5]}", "schedule", "energy_mj 50 -> 5; linear"),
    ("lidar.detector.crosstalk={}", "with", "crosstalk"),
    ('lidar.detector.returns="last"', "with", "returns: last"),
]


def test_what_there_is_besides_has_a_line(described):
    coarse = ("lidar.receiver.n_rows=8", "lidar.receiver.n_cols=8")
    lines = described(*coarse, *(setting for setting, _, _ in BESIDES))
    assert not [(line, words) for _, line, words in BESIDES if words not in lines[line]]


class TestBudget:
    def number(self, line, pattern):
        return float(re.search(pattern, line)[1].replace(",", ""))

    def test_the_seeds_camera(self, text, described):
        """Seed, section 5: 1000 photons and 95 % at 3 km; 4000 pixels tell 0.95 to ± 0.014 (four sigma).

        The plate of 4 m fills four pixels of 1.023 m about the boresight, and takes part of twelve: their median is dimmer.
        """
        camera = text[: text.index("[lidar.laser]")] + '[lidar]\npreset = "gsfl_1064"\n'
        facing = camera.replace("[1000, 0, 0]", "[3000, 0, 0]").replace("rate_deg_s = 10", "rate_deg_s = 0")
        line = described(bench=facing)["first"]
        assert self.number(line, r"to ([\d,]+) photons") == pytest.approx(1000, abs=10)
        assert self.number(line, r"P\(detect\) [\d.]+ to ([\d.]+)") == pytest.approx(0.95, abs=0.014)
        assert "fills 100% of its brightest pixel" in line and line.endswith("(one attitude)")

    def test_it_follows_the_plan(self, described):
        """A tenth of the energy, in the last of ten frames at 1.8 s, is a tenth of the photons."""
        lines = described("lidar.schedule={time_s=[0, 1.8], energy_mj=[50, 5], focal_length_mm=[70, 140]}", frames=10)
        first, last = (self.number(lines[place], r"([\d,]+) photons") for place in ("first", "last"))
        assert last == pytest.approx(first / 10, rel=1e-3)
        first, last = (self.number(lines[place], r"pixel ([\d.]+) m") for place in ("first", "last"))
        assert (first, last) == pytest.approx((100e-6 / 0.070 * 1000, 100e-6 / 0.140 * 1000), rel=1e-3)

    def test_a_beam_that_passes_by_lights_nothing(self, described):
        line = described("lidar.laser.offset_m=[30, 0, 0]")["first"]
        assert " 0 photons" in line
        assert "range noise none" in line

    @pytest.mark.parametrize(
        "settings",
        [
            ("target.0.motion.position_m=[900000, 0, 0]",),
            ("target.0.motion.position_m=[-1000, 0, 0]", 'ptu.point={type="fixed"}'),
            ("target.0.motion.position_m=[1, 0, 0]",),
            ("lidar.laser.energy_mj=1e-9",),
            ("lidar.laser.energy_mj=1e9",),
            ('target.0.material={type="lambertian", reflectance=0.0}',),
            ("lidar.detector.gate={delay_ns=1e9}",),
            ("lidar.detector.armed_from_m=2000",),
            ("lidar.receiver.n_rows=1", "lidar.receiver.n_cols=1"),
            (
                'target.0.material={type="retro_reflector", diameter_mm=20.0, reflectance=0.9, fill_fraction=0.1}',
                "lidar.detector.saturation={}",
                "lidar.detector.droop={}",
            ),
        ],
    )
    def test_dark_far_and_blinding_targets_are_described(self, described, settings):
        line = described("lidar.receiver.n_rows=8", "lidar.receiver.n_cols=8", *settings)["first"]
        assert 0.0 <= self.number(line, r"P\(detect\) ([\d.]+)") <= 1.0


class TestWhatFits:
    """A plate of 4 x 4 m, 2.5° of field and 128 pixels: at 1000 m 11.7 pixels of 0.341 m, at 80 m wider than the field."""

    def test_across_is_its_own_extent_wherever_its_origin_is(self, text, described):
        for middle in ("", "center_of_mass_m = [0, 2.0, 0]\n"):
            bench = text.replace("[[target]]\n", f"[[target]]\n{middle}").replace("= 32", "= 128")
            assert re.search(r"target (\d+) pixels across", described(bench=bench)["first"])[1] == "12", middle

    def test_one_that_is_cut_off_is_told_by_line_and_warning(self, text, described):
        line = described()["sight"]
        assert line.endswith("its origin in the field 100% of the time, all of it 100%")
        near = text.replace("[1000, 0, 0]", "[80, 0, 0]")
        lines = described(bench=near)
        assert lines["sight"].endswith("its origin in the field 100% of the time, all of it 0%")
        assert "part of it is outside the field of view 100% of the time, first at 0 s, 80 m away" in "".join(
            rl.Scenario.loads(near).advice()
        )


@pytest.mark.slow
def test_retro_reflectors_count_in_what_check_casts_and_not_in_a_filled_pixel():
    """Envisat's cube corners send 1e4 times the light of its optical solar reflectors; its black paint is the dimmest."""
    scenario = rl.Scenario.loads(ENVISAT)
    lines = {line.split()[0]: line for line in scenario.describe().splitlines()}
    median, most = (float(one.replace(",", "")) for one in re.search(PHOTONS, lines["first"]).groups())
    photons = next(iter(rl.simulate(scenario))).labels.photons
    photons = np.sort(photons[photons > 0.0])
    assert (median, most) == pytest.approx((photons[len(photons) // 2], photons[-1]), abs=0.5)
    made = rl.budget(scenario)
    assert [curve.material for curve in made.curves] == ["black_paint", "osr"]
    assert "retro-reflectors of the target" in made.table()
    assert len(rl.budget(scenario, materials="cube_corner").curves) == 1
    assert "not counted: retro" not in rl.budget(scenario, materials="cube_corner").table()


PHOTONS = r"([\d,]+) to ([\d,]+) photons"
TUMBLING = """
version = 1
name = "a body that tumbles"
time = { start_utc = 2024-01-01T00:00:00Z, duration_s = 40, frame_rate_hz = 1 }
world = { axes = "local" }
follower = { motion = { type = "fixed", position_m = [0, 0, 0] } }
[[target]]
name = "body"
model = "MODEL"
motion = { type = "fixed", position_m = [RANGE, ASIDE, ASIDE] }
attitude = { type = "tumble", inertia_kg_m2 = [5, 4, 2], body_rate_deg_s = [11, 7, 9] }
[lidar]
laser = { wavelength_nm = NM, energy_mj = 10, divergence_deg = 3, pulse_fwhm_ns = 8 }
receiver = { fov_deg = 3, f_number = 2.8, transmission = 0.67 }
"""


@pytest.mark.parametrize(
    ("model", "wavelength_nm", "range_m"),
    [
        ("cubesat_1u", 1570, 640),
        pytest.param("debris_shard", 1064, 400, marks=pytest.mark.slow),
        pytest.param("tdrs", 1064, 1700, marks=pytest.mark.slow),
    ],
)
def test_a_body_is_described_as_its_frames_are(model, wavelength_nm, range_m):
    """The body that is there, not a pixel that it fills: 40 frames with the noise of four seeds, and 40 attitudes.

    Of the shares of detection the binomial spread of both tells how near they come (4 sigma); photons are expectations.
    """
    text = TUMBLING.replace("MODEL", model).replace("NM", str(wavelength_nm)).replace("RANGE", str(range_m))
    scenario = rl.Scenario.loads(
        text.replace("ASIDE", str(0.2e-3 * range_m))
    )  # half a pixel of 0.41 mrad off the middle
    line = next(line for line in scenario.describe().splitlines() if line.startswith("  first"))
    assert line.endswith("(mean of 40 attitudes)")
    photons, detected = [], []
    for number, frame in enumerate(rl.simulate(scenario, keep=["photons"])):
        best = frame.labels.photons.argmax()
        photons.append(float(frame.labels.photons.ravel()[best]))
        others = (scenario.replace(seed=seed).rng(number) for seed in range(1, 4))
        readings = [rl.detector.detect(frame.kept["photons"], scenario.lidar.detector, rng)[0] for rng in others]
        for reading in (frame.observation.reading, *readings):
            error_m = float(reading.range_m.ravel()[best]) - float(frame.labels.range_m.ravel()[best])
            detected.append(abs(error_m) < 5.0)
    told = float(re.search(r"([\d,]+) photons", line)[1].replace(",", ""))
    assert told == pytest.approx(np.median(photons), rel=0.01, abs=0.5)
    share, probability = np.mean(detected), float(re.search(r"P\(detect\) (?:[\d.]+ to )?([\d.]+)", line)[1])
    spread = np.sqrt(max(probability * (1.0 - probability), 1e-3) * (1.0 / len(detected) + 1.0 / 4000))
    assert 0.1 < probability < 0.9, line
    assert probability == pytest.approx(share, abs=4.0 * spread)


class TestSeveralReturns:
    def test_the_separations_that_the_trace_holds_are_told(self, described):
        """Those that `listed_separations` finds: from a pulse's length to what 20 samples leave, less in brighter light."""
        line = described("lidar.detector.max_returns=2")["returns"]
        near, far, brighter = (
            float(x) for x in re.search(r"([\d.]+) to ([\d.]+) m with .* to ([\d.]+) m", line).groups()
        )
        assert 1.2 < near < 2.0 < brighter < far - 0.3 < 3.0
        assert "returns" not in described()
        longer = described("lidar.detector.max_returns=2", "lidar.detector.readout.samples=60")["returns"]
        # 40 samples more are 14.3 m more.
        assert float(re.search(r"to ([\d.]+) m with", longer)[1]) == pytest.approx(far + 14.3, abs=0.2)

    @pytest.mark.parametrize(
        ("tilt_deg", "depth_m", "words"), [(0.0, 0.0, "merge"), (35.0, 2.3, None), (75.0, 3.9, "can be parted too far")]
    )
    def test_parts_out_of_them_are_warned_of(self, text, tilt_deg, depth_m, words):
        """A plate of 4 m a side at a tilt is 4 sin(tilt) deep: 0, 2.3 and 3.9 m, where 1.7 to 2.8 m are listed."""
        settings = (
            "lidar.detector.max_returns=2",
            f"target.0.attitude={{type='fixed', euler_zyx_deg=[0, {tilt_deg}, 0]}}",
        )
        (line,) = (
            one for one in rl.Scenario.loads(text, settings=settings).advice() if "about the first crossing" in one
        )
        if words is None:
            assert "the two edges" not in line
        else:
            assert re.search(rf"the two edges of .*\({depth_m:.1f} m\) {words}", line)

    def test_a_part_that_turns_counts_where_it_is_deepest(self, text):
        """From facing the lidar to 67.5 degrees off in the last of ten frames."""
        settings = (
            "lidar.detector.max_returns=2",
            "target.0.attitude={type='spin', axis=[0, 1, 0], rate_deg_s=37.5}",
        )
        lines = rl.Scenario.loads(text, settings=settings).advice()
        assert any(re.search(r"the two edges of .*\(3\.7 m\) can be parted too far", line) for line in lines)
