"""The parameters of a mission: what the scenario says, with the units and meanings of the fields alone."""

import csv
import importlib
import io
import json
import math
import pkgutil
import re

import numpy as np
import pytest

import rso_lidar
import rso_lidar as rl
from rso_lidar.detector import LaserPulse, detect, predict
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.mission_analysis import list_parameters
from rso_lidar.mission_analysis.mission_parameters.parameter_list import _read_unit, iterate_parameters
from rso_lidar.mission_analysis.mission_parameters.sysml_units import UNITS
from rso_lidar.part import Part
from tests.detector.returns_for_tests import nothing

WORDS = {  # units for which SysML has none: numbers there, with the unit in words
    "pixels", "photons", "electrons", "counts", "bits", "counts/photon", "electrons/count", "1/R⊕",
}  # fmt: skip


@pytest.fixture(scope="module")
def table():
    return list_parameters(rl.Scenario.load("examples/tdrs_approach.toml"))


def test_derived_numbers_are_printed_as_people_write_them(table):
    assert repr(table.find("lidar.receiver.pixel_pitch_m").value) == "9.999999999999999e-05"
    (line,) = [line for line in table.table().splitlines() if line.startswith("lidar.receiver.pixel_pitch_m ")]
    assert line.split() == ["lidar.receiver.pixel_pitch_m", "0.0001", "m", "derived"]
    assert "9.999999999999999e-05" in table.csv_text()


def test_values_are_those_of_the_scenario(table):
    laser = table.find("lidar.laser.wavelength_nm")
    assert (laser.value, laser.unit, laser.default, laser.source) == (1064.0, "nm", 1064.0, "scenario")
    assert laser.meaning == "Wavelength in vacuum."
    assert table.find("target.tdrs.material.reflectance").value == 0.3
    assert table.find("follower.motion.position_m").value == (0.0, -3000.0, 0.0)
    assert table.find("ptu.response.tilt_limits_deg").value is None
    rows = table.find("lidar.receiver.n_rows")
    assert (rows.value, rows.source) == (128, "default: Fuller et al., sec. 3.3")
    assert not rows.is_derived and rows.is_number and not table.find("time.start_utc").is_number


def test_every_field_of_every_part_is_there(table):
    paths = [one.path for one in table.parameters]
    assert len(set(paths)) == len(paths)
    scenario = rl.Scenario.load("examples/tdrs_approach.toml")
    receiver = list(type(scenario.lidar.receiver).model_fields)
    assert [f"lidar.receiver.{name}" for name in receiver] == [
        one.path for one in table.parameters if one.path.startswith("lidar.receiver.") and not one.is_derived
    ]


def test_derived_figures_are_marked(table):
    ifov = table.find("lidar.receiver.ifov_rad")
    assert ifov.is_derived and ifov.unit == "rad" and ifov.source == "derived"
    assert ifov.value == pytest.approx(341e-6, rel=1e-3)
    photons = table.find("lidar.laser.photons")
    assert photons.value == pytest.approx(0.05 * 1064e-9 / (6.62607015e-34 * 299792458.0))
    assert photons.unit == "photons"


def test_false_alarms_and_light_of_a_detector_are_those_of_its_frames():
    """A gain of 80 triggers 4,400 times as often as Gaussian noise: a share 1 - exp(-rate x time) of 8 x 64 x 64 pixels."""
    settings = (
        "lidar.detector.apd={gain=80, ionisation_ratio=0.02, dark_current_na=0.05}",
        "lidar.detector.armed_to_m=1500",
    )
    scenario = rl.Scenario.load("examples/tdrs_approach.toml", settings)
    by_path = {one.path: one for one in iterate_parameters(scenario) if one.path.startswith("lidar.detector.")}
    rate = by_path["lidar.detector.false_alarms_per_s"]
    assert rate.unit == "1/s" and rate.is_derived
    gaussian = math.exp(-0.5 * scenario.lidar.detector.threshold_over_noise**2) / (2.0 * math.pi * 1.0243e-9)
    assert rate.value > 4000.0 * gaussian
    rng, frames = np.random.default_rng(5), 8
    seen = [np.isfinite(detect(nothing((64, 64)), scenario.lidar.detector, rng)[0].range_m) for _ in range(frames)]
    share = -math.expm1(-rate.value * (1500.0 - 1.0) / rl.units.RANGE_PER_DELAY_M_S)
    # where single avalanches dominate the law is up to a quarter too high; elsewhere 4 binomial sigma
    sigma = math.sqrt(share * (1.0 - share) / (frames * 64 * 64))
    assert 0.75 * share - 4.0 * sigma < np.mean(seen) < share + 4.0 * sigma
    half, most = (by_path[f"lidar.detector.photons_at_{percent}_percent"] for percent in (50, 95))
    assert half.unit == "photons" and half.value < most.value
    pulse = LaserPulse(*scenario.lidar.laser.pulse, scenario.lidar.laser.pulse_fwhm_s)
    found = predict(scenario.lidar.detector, pulse, np.array([half.value, most.value]), 0.0).probability
    assert found == pytest.approx([0.5, 0.95], abs=1e-3)


def test_a_rate_of_false_alarms_that_is_a_key_is_listed_once():
    scenario = rl.Scenario.load("examples/tdrs_approach.toml", ('lidar.detector.type="empirical"',))
    (rate,) = [one for one in iterate_parameters(scenario) if one.path == "lidar.detector.false_alarms_per_s"]
    assert not rate.is_derived
    gated = rl.Scenario.load("examples/geiger_bench.toml")
    assert "lidar.detector.false_alarms_per_s" not in [one.path for one in iterate_parameters(gated)]


def test_presets_are_sources():
    scenario = rl.Scenario.load("examples/proximity_1570.toml")
    by_path = {one.path: one for one in iterate_parameters(scenario)}
    assert by_path["lidar.receiver.fov_deg"].source == "preset proximity_1570"
    assert by_path["lidar.laser.offset_m"].source == "scenario"
    offset = scenario.replace(lidar=scenario.lidar.replace(detector=rl.Gsfl(preset="offset_limited")))
    by_path = {one.path: one for one in iterate_parameters(offset)}
    assert by_path["lidar.detector.trigger.threshold_electrons"].source == "preset offset_limited"


def test_a_python_object_has_a_name():
    class Mirror:
        is_retro = False

        def brdf_per_sr(self, *given):
            return 0.0

        def summarize(self):
            return "mirror"

    scenario = rl.Scenario.load("examples/tdrs_approach.toml")
    target = scenario.target[0].replace(material=Mirror())
    (one,) = [
        one for one in iterate_parameters(scenario.replace(target=(target,))) if one.path == "target.tdrs.material"
    ]
    assert "Mirror" in one.value


def test_all_units_of_all_parts_are_known():
    for module in pkgutil.walk_packages(rso_lidar.__path__, "rso_lidar."):
        if "__main__" not in module.name and ".torch" not in module.name:
            importlib.import_module(module.name)

    def subclasses(cls):
        for one in cls.__subclasses__():
            yield one
            yield from subclasses(one)

    found = {
        _read_unit(text)
        for cls in subclasses(Part)
        if cls.__module__.startswith("rso_lidar.")
        for field in cls.model_fields.values()
        for text in re.findall(r"(?<!`)\[([^\[\]]+)\]", field.description or "")
    }
    assert len(found) > 25
    assert found - set(UNITS) - WORDS == {""}  # brackets of a list of numbers


def test_csv_and_json_have_all_columns(table, tmp_path):
    rows = list(csv.DictReader(io.StringIO(table.csv_text())))
    assert len(rows) == len(table.parameters)
    assert rows[0].keys() == {"path", "value", "unit", "meaning", "default", "source", "is_derived"}
    (row,) = [row for row in rows if row["path"] == "lidar.detector.readout.electrons_per_count"]
    assert (row["value"], row["unit"], row["is_derived"]) == ("200.0", "electrons/count", "0")
    tree = json.loads(table.save(tmp_path / "p.json").read_text(encoding="utf-8"))
    assert len(tree["parameters"]) == len(rows) and tree["name"] == "TDRS hop, 3 km to 300 m"
    assert table.save(tmp_path / "p.csv").read_text(encoding="utf-8") == table.csv_text()
    with pytest.raises(RecordingError, match=r"known: \.csv, \.json, \.sysml"):
        table.save(tmp_path / "p.xml")


def test_what_is_not_there_is_said(table):
    with pytest.raises(ScenarioError, match=r"did you mean 'lidar\.laser\.energy_mj'\?"):
        table.find("lidar.laser.energy_mJ")
    with pytest.raises(ScenarioError, match="parameters: needs a Scenario"):
        list_parameters("examples/tdrs_approach.toml")
