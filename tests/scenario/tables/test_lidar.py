"""The instrument of a scenario: what follows a plan, what a controller commands, and the files that it names."""

import math

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.scenario import Schedule

PLAN = {"time_s": (1.0, 2.0, 4.0), "energy_mj": (10.0, 20.0, 40.0), "focal_length_mm": (70.0, 80.0, 120.0)}

# What instruments may have beyond the plain one, as settings of the bench.
INSTRUMENTS = {
    "a plan": (
        "lidar.schedule={time_s=[0, 1], energy_mj=[50, 5], focal_length_mm=[70, 110], divergence_deg=[2.5, 1]}",
    ),
    "steps": ('lidar.schedule={time_s=[0.5], energy_mj=[5], interpolation="step"}',),
    "a gate that moves": (
        "lidar.detector.gate={delay_ns=6650, width_ns=60, pulses=3}",
        "lidar.schedule={time_s=[0, 1], gate_delay_ns=[6640, 6650]}",
    ),
    "a blurred image": ('lidar.receiver.psf={type="gaussian", sigma_um=40, halo_fraction=0.1, halo_radius_um=200}',),
    "kernels over the field": (
        'lidar.receiver.psf={type="field_dependent", fields=[{field_deg=0, psf={type="airy"}}, '
        '{field_deg=1, psf={type="gaussian", sigma_um=30}}]}',
    ),
    "a bent image": ('lidar.receiver.distortion={type="brown_conrady", k1=-20.0, p1=0.01}',),
    "a laser aside": (
        "lidar.laser.offset_m=[0.2, 0, 0]",
        "lidar.laser.timing_jitter_ns=0.3",
        'lidar.laser.footprint="circle"',
    ),
    "a long pulse": ('lidar.laser.pulse_shape="super_gaussian"', "lidar.laser.pulse_order=3"),
    "sunlight": ("lidar.receiver.filter_width_nm=5", "world.sun_direction=[-1, 0, 0.2]"),
    "a real focal plane": tuple(
        f"lidar.detector.{name}={{}}" for name in ("maps", "defects", "saturation", "droop", "crosstalk", "speckle")
    ),
    "further returns": ('lidar.detector.returns="strongest"', "lidar.detector.max_returns=4"),
    "another chain": (
        'lidar.detector.preset="offset_limited"',
        'lidar.detector.ranging.algorithm="constant_fraction"',
        "lidar.detector.amplifier.bandwidth_mhz=150",
    ),
    "the fast model": ('lidar.detector.type="empirical"',),
}


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_each_is_resolved_loads_back_and_flies(text, name):
    scenario = rl.Scenario.loads(text, settings=INSTRUMENTS[name])
    again = rl.Scenario.loads(scenario.dumps())
    assert again.lidar == scenario.lidar
    assert again.dumps() == scenario.dumps()
    one, two = (next(rl.simulate(each, frames=[4])) for each in (scenario, again))
    np.testing.assert_array_equal(one.range_m, two.range_m)
    np.testing.assert_array_equal(one.intensity_counts, two.intensity_counts)


class TestSchedule:
    def test_linear_between_and_flat_beyond(self):
        plan = Schedule(**PLAN)
        assert plan.planned == ("focal_length_mm", "energy_mj")
        assert plan.at(-5.0) == {"focal_length_mm": 70.0, "energy_mj": 10.0}
        assert plan.at(1.5) == {"focal_length_mm": 75.0, "energy_mj": 15.0}
        assert plan.at(3.0) == {"focal_length_mm": 100.0, "energy_mj": 30.0}
        assert plan.at(99.0) == {"focal_length_mm": 120.0, "energy_mj": 40.0}

    def test_steps_hold_until_the_next(self):
        plan = Schedule(**PLAN, interpolation="step")
        asked = [(-1, 10), (1, 10), (1.999, 10), (2, 20), (3.999, 20), (4, 40), (9, 40)]
        for time_s, energy_mj in asked:
            assert plan.at(time_s)["energy_mj"] == energy_mj, time_s

    @pytest.mark.parametrize(
        ("changes", "words"),
        [
            ({"energy_mj": (1.0, 2.0)}, "energy_mj has 2 entries and time_s 3; match them"),
            ({"time_s": (1.0, 1.0, 2.0)}, "time_s does not increase"),
            ({"time_s": (3.0, 2.0, 1.0)}, "time_s does not increase"),
            ({"time_s": ()}, "time_s is empty"),
            ({"energy_mj": None, "focal_length_mm": None}, "no setting is planned"),
            ({"energy_mj": (1.0, -2.0, 3.0)}, r"energy_mj\[1\].*greater than 0"),
            ({"energy_mj": (1.0, math.nan, 3.0)}, r"energy_mj\[1\].*finite"),
            ({"divergence_deg": (1.0, 180.0, 3.0)}, r"divergence_deg\[1\].*less than 180"),
            ({"gate_delay_ns": (1.0, 2.0, -1.0)}, r"gate_delay_ns\[2\]"),
            ({"energy": (1.0, 2.0, 3.0)}, "did you mean 'energy_mj'"),
            ({"interpolation": "cubic"}, "known: linear, step"),
        ],
    )
    def test_bad_plans(self, changes, words):
        with pytest.raises(ScenarioError, match=words) as error:
            Schedule(**{**PLAN, **changes})
        assert "\n" not in str(error.value)

    def test_a_gate_is_planned_only_where_there_is_one(self, text):
        with pytest.raises(ScenarioError, match=r"schedule\.gate_delay_ns needs a gate.*\[lidar\.detector\.gate\]"):
            rl.Scenario.loads(text, settings=("lidar.schedule={time_s=[0], gate_delay_ns=[1]}",))

    def test_what_a_zoom_lens_would_meet_is_told_before_the_first_flash(self, text):
        """A distortion that the long lens bears and the short one, with its wider field, does not."""
        bent = ('lidar.receiver.distortion={type="brown_conrady", k1=-100.0}',)
        _ = rl.Scenario.loads(text, settings=bent).instrument
        zooms = (*bent, "lidar.schedule={time_s=[0, 1], focal_length_mm=[70, 15]}")
        with pytest.raises(ScenarioError, match="distortion"):
            _ = rl.Scenario.loads(text, settings=zooms).instrument


@pytest.mark.parametrize(
    ("kind", "key", "owner"),
    [("gsfl", "counts_per_photon", "empirical"), ("gsfl", "pulses", "geiger"), ("geiger", "gate", "gsfl")],
)
def test_a_key_of_another_detector_names_that_detector(text, kind, key, owner):
    with pytest.raises(
        ScenarioError, match=rf"lidar\.detector: unknown key '{key}'; it is a key of type = \"{owner}\"$"
    ):
        rl.Scenario.loads(text, settings=(f'lidar.detector={{type="{kind}", {key}=1}}',))


class TestInForce:
    @pytest.fixture
    def lidar(self):
        return rl.Lidar(
            receiver=rl.Receiver(fov_deg=2.5, f_number=2.8, n_rows=32, n_cols=32),
            detector=rl.Gsfl(gate={"delay_ns": 6650.0}),
            schedule=Schedule(**PLAN),
        )

    def test_the_plan(self, lidar):
        planned = lidar.at(3.0)
        assert planned.settings["laser_energy_j"] == pytest.approx(0.030, rel=1e-12)
        assert planned.settings["focal_length_m"] == pytest.approx(0.100, rel=1e-12)
        assert planned.settings["aperture_m"] == pytest.approx(0.100 / 2.8, rel=1e-12)  # the f-number is the lens's
        assert lidar.settings["laser_energy_j"] == 0.050

    def test_commands_come_before_the_plan(self, lidar):
        command = rl.Command(energy_j=0.007, divergence_rad=0.01, gate_delay_s=6e-6)
        settings = lidar.at(3.0, command).settings
        assert settings["laser_energy_j"] == pytest.approx(0.007, rel=1e-12)
        assert settings["laser_divergence_rad"] == pytest.approx(0.01, rel=1e-12)
        assert settings["gate_delay_s"] == pytest.approx(6e-6, rel=1e-12)
        assert settings["focal_length_m"] == pytest.approx(0.100, rel=1e-12)  # not commanded: as planned

    def test_zoom_changes_where_pixels_look(self, lidar):
        """A pixel p from the middle looks along atan(p pitch / f)."""
        tangents = [lens.receiver.line_of_sight for lens in (lidar.at(1.0), lidar.at(4.0))]
        short, long = (table[0, 0, 0] / table[0, 0, 2] for table in tangents)
        assert short == pytest.approx(-15.5 * 100e-6 / 0.070, rel=1e-12)
        assert long == pytest.approx(-15.5 * 100e-6 / 0.120, rel=1e-12)

    def test_no_plan_and_no_command_is_the_lidar_itself(self):
        lidar = rl.Lidar(preset="gsfl_1064")
        assert lidar.at(3.0) is lidar
        assert lidar.at(3.0, rl.Command(pan_rad=0.1)) is lidar

    @pytest.mark.parametrize("field", ["focal_length_m", "divergence_rad", "energy_j", "gate_delay_s"])
    @pytest.mark.parametrize("value", [-1.0, math.nan, math.inf, "much", True, np.array([0.1]), [0.1], 10**400])
    def test_bad_commands_get_one_line(self, lidar, field, value):
        with pytest.raises(ScenarioError, match=r"^simulate: the controller's command: ") as error:
            lidar.at(0.0, rl.Command(**{field: value}))
        assert "\n" not in str(error.value)

    def test_numpys_numbers_are_numbers(self, lidar):
        assert lidar.at(0.0, rl.Command(energy_j=np.float64(0.01))).laser.energy_mj == pytest.approx(10.0)

    def test_a_gate_that_is_not_there_cannot_be_commanded(self):
        with pytest.raises(ScenarioError, match="gate_delay_s: the detector has no gate"):
            rl.Lidar(preset="gsfl_1064").at(0.0, rl.Command(gate_delay_s=1e-6))


class TestLengths:
    """Lengths of time that do not fit to each other would fill the memory."""

    @pytest.mark.parametrize(
        "setting",
        [
            "lidar.laser.pulse_fwhm_ns=1e6",
            "lidar.laser.pulse_fwhm_ns=1e-6",
            "lidar.detector.readout.sample_ns=1e6",
            "lidar.detector.readout.sample_ns=1e-6",
            "lidar.detector.amplifier.bandwidth_mhz=1e-6",
        ],
    )
    def test_too_many_steps(self, text, setting):
        with pytest.raises(ScenarioError, match=r"^bench: lidar: a pulse of .* steps of time for each pixel.*; bring"):
            _ = rl.Scenario.loads(text, settings=(setting,), where="bench").instrument

    def test_too_long_a_gate(self, text):
        long = ("lidar.detector.gate={delay_ns=10, width_ns=1e9}",)
        with pytest.raises(ScenarioError, match=r"detector\.gate\.width_ns: .*in 1,024 pixels.*take up to"):
            _ = rl.Scenario.loads(text, settings=long).instrument

    def test_what_instruments_have_is_allowed(self, text):
        for pulse_ns in (0.5, 8, 100):
            lidar = rl.Scenario.loads(text, settings=(f"lidar.laser.pulse_fwhm_ns={pulse_ns}",)).instrument
            assert lidar.laser.pulse_fwhm_s == pytest.approx(1e-9 * pulse_ns, rel=1e-12)


class TestFiles:
    @pytest.fixture
    def folder(self, tmp_path):
        (tmp_path / "optics").mkdir()
        (tmp_path / "optics" / "psf.csv").write_text("0 1 0\n1 4 1\n0 1 0\n", encoding="utf-8")
        (tmp_path / "optics" / "pattern.csv").write_text("1 2 1\n2 3 2\n1 2 1\n", encoding="utf-8")
        (tmp_path / "pulse.csv").write_text("time_ns,power\n0,0\n2,1\n4,3\n9,0\n", encoding="utf-8")
        return tmp_path

    @pytest.fixture
    def named(self, text, folder):
        beam = 'footprint = "pattern"\npattern_file = "optics/pattern.csv"\npulse_shape = "measured"\n'
        beam += 'pulse_file = "pulse.csv"\n'
        lens = 'psf = { type = "grid", file = "optics/psf.csv", spacing_um = 30 }\n'
        path = folder / "bench.toml"
        path.write_text(text.replace("[lidar.laser]", f"[lidar.laser]\n{beam}") + lens, encoding="utf-8")
        return path

    def test_they_are_found_beside_the_scenario(self, named, monkeypatch, tmp_path_factory):
        monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
        scenario = rl.Scenario.load(named)
        frame = next(rl.simulate(scenario, frames=[0]))
        assert frame.valid.any()
        assert scenario.lidar.laser.pulse_file == "pulse.csv"  # what the user wrote stays
        # Half of the measured pulse's 3 units of power: rising at 2.5 ns, falling at 6.5 ns.
        assert frame.observation.settings["pulse_fwhm_s"] == pytest.approx(4.0e-9, rel=0.02)

    def test_their_contents_stand_in_the_source(self, named, folder):
        before = rl.Scenario.load(named).dumps()
        for name in ("psf.csv", "pattern.csv", "pulse.csv"):
            assert f"# file {name} of the lidar: SHA-256 " in before
        (folder / "pulse.csv").write_text("0,0\n2,1\n4,2\n9,0\n", encoding="utf-8")
        after = rl.Scenario.load(named).dumps()
        assert sum(a != b for a, b in zip(before.splitlines(), after.splitlines(), strict=True)) == 1

    def test_the_resolved_text_finds_them_in_the_same_folder(self, named, folder):
        scenario = rl.Scenario.load(named)
        again = rl.Scenario.loads(scenario.dumps(), folder=folder)
        assert again.dumps() == scenario.dumps()

    @pytest.mark.parametrize("name", ["pulse.csv", "optics/pattern.csv", "optics/psf.csv"])
    def test_one_that_is_missing_gets_one_line(self, named, folder, name):
        (folder / name).unlink()
        scenario = rl.Scenario.load(named)
        for act in (scenario.describe, scenario.dumps, lambda: next(rl.simulate(scenario))):
            with pytest.raises(
                ScenarioError, match=rf"^bench\.toml: lidar: no file '{name}' beside the scenario"
            ) as error:
                act()
            assert "\n" not in str(error.value)

    @pytest.mark.parametrize(
        ("name", "content", "words"),
        [
            ("pulse.csv", b"", "pulse.csv"),
            ("pulse.csv", b"1\n2\n3\n", "two columns"),
            ("pulse.csv", b"0 0\n2 1\n1 3\n", "must be finite and ascend"),
            ("optics/pattern.csv", b"0 0\n0 0\n", "pattern"),
            ("optics/pattern.csv", bytes(range(128, 256)), "not text"),
            ("optics/psf.csv", b"0 1 0\n1 x 1\n", "line 2"),
            ("optics/psf.csv", b"0 1 0\n1 4\n", "cut off"),
            ("optics/psf.csv", b"0 1\n1 -4\n", "negative"),
        ],
    )
    def test_bad_contents_get_one_line(self, named, folder, name, content, words):
        (folder / name).write_bytes(content)
        with pytest.raises(ScenarioError, match=words) as error:
            _ = rl.Scenario.load(named).instrument
        assert str(error.value).startswith("bench.toml: lidar: ")
        assert "\n" not in str(error.value)


def test_a_source_of_shipped_files_flies_again_in_another_folder(monkeypatch, tmp_path):
    settings = ("lidar.receiver.n_rows=16", "lidar.receiver.n_cols=16", 'lidar.detector={type="gsfl"}')
    settings += ("time.duration_s=10", "lidar.laser.energy_mj=5000")
    scenario = rl.Scenario.load("examples/tdrs_approach.toml", settings)
    frame = next(rl.simulate(scenario, frames=[1]))
    assert frame.valid.any()
    monkeypatch.chdir(tmp_path)
    again = next(rl.simulate(rl.Scenario.loads(frame.source.scenario, folder=tmp_path), frames=[1]))
    np.testing.assert_array_equal(again.range_m, frame.range_m)
    assert again.source.scenario == frame.source.scenario
