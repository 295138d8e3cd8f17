"""Parameters of a sensor: all of a lidar, with meanings, and which are assumed."""

import json

import rso_lidar as rl
from rso_lidar.dataset.publication.card_tables import list_parameters
from rso_lidar.imaging import Camera
from rso_lidar.scenario import Lidar


def dump(part):
    return json.dumps(part.model_dump(mode="json", exclude_none=True))


def find_parameters(**parts):
    """Return the parameters of a lidar by place."""
    lidar = Lidar(**{"laser": rl.Laser(divergence_deg=2.5), "receiver": rl.Receiver(fov_deg=2.5, f_number=2.8)} | parts)
    return {one.place: one for one in list_parameters(dump(lidar), "lidar", Lidar)}


def test_parameters_have_places_values_and_meanings():
    found = find_parameters(laser=rl.Laser(energy_mj=40.0, divergence_deg=2.5))
    assert found["lidar.laser.energy_mj"].value == "40.0"
    assert found["lidar.laser.wavelength_nm"].meaning.endswith(".")
    assert not found["lidar.laser.energy_mj"].is_assumed


def test_a_default_that_has_no_source_is_assumed_until_it_is_set():
    place = "lidar.detector.adc_bits"
    default, chosen = (find_parameters(detector=part) for part in (rl.Empirical(), rl.Empirical(adc_bits=14)))
    assert default[place].is_assumed and "assumed" in default[place].meaning
    assert chosen[place].value == "14" and not chosen[place].is_assumed


def test_an_unknown_instrument_is_listed_without_meanings():
    found = list_parameters(json.dumps({"detector": {"type": "mine", "gain": [1, 2.5]}}), "lidar", Lidar)
    assert [(one.place, one.value, one.meaning) for one in found] == [
        ("lidar.detector.type", '"mine"', ""),
        ("lidar.detector.gain", "[1, 2.5]", ""),
    ]


def test_a_camera_is_listed_with_what_is_assumed():
    camera = Camera(name="nav", lens={"fov_deg": 10, "f_number": 4}, sensor={"bits": 10})
    found = {one.place: one for one in list_parameters(dump(camera), "camera.nav", Camera)}
    assert found["camera.nav.sensor.bits"].value == "10" and not found["camera.nav.sensor.bits"].is_assumed
    assert found["camera.nav.sensor.read_noise_electrons"].is_assumed
    assert found["camera.nav.lens.fov_deg"].value == "10.0"
