"""A scenario says the same whichever way it was written, and can be flown again from what a frame carries."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError


def test_load_and_loads_agree(text, tmp_path):
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    assert rl.Scenario.load(path) == rl.Scenario.loads(text)


def test_python_says_the_same(text):
    scenario = rl.Scenario(
        version=1,
        name="a plate on a bench",
        seed=7,
        world=rl.World(axes="local"),
        time=rl.Time(start_utc=rl.Scenario.loads(text).time.start_utc, duration_s=2, frame_rate_hz=5),
        target=[
            rl.Target(
                name="plate",
                model="plate",
                material=rl.Lambertian(reflectance=0.30),
                motion=rl.Fixed(position_m=(1000, 0, 0)),
                attitude=rl.Spin(axis=(0, 0, 1), rate_deg_s=10),
            )
        ],
        follower=rl.Follower(motion=rl.Fixed(position_m=(0, 0, 0))),
        ptu=rl.Ptu(
            point=rl.TrackPoint(at="plate"),
            response=rl.SecondOrder(natural_hz=4.0, damping=0.7),
            errors=rl.PointingErrors(jitter_deg=0.001, encoder_noise_deg=0.001),
        ),
        lidar=rl.Lidar(
            laser=rl.Laser(energy_mj=50),
            receiver=rl.Receiver(fov_deg=2.5, f_number=2.8, n_rows=32, n_cols=32, rays_per_pixel=4),
        ),
    )
    assert scenario == rl.Scenario.loads(text)
    assert scenario != scenario.replace(seed=8)


def test_replace_validates(text):
    scenario = rl.Scenario.loads(text)
    with pytest.raises(ScenarioError, match="seed"):
        scenario.replace(seed=-1)
    laser = scenario.lidar.laser
    with pytest.raises(ScenarioError, match="energy_mj"):
        laser.replace(energy_mj=0)
    assert laser.replace(energy_mj=1).energy_mj == 1
    assert laser.energy_mj == 50


def test_the_source_flies_again(text):
    scenario = rl.Scenario.loads(text)
    frame = next(rl.simulate(scenario, frames=[4]))
    again = rl.Scenario.loads(frame.source.scenario)
    assert again.source.scenario == frame.source.scenario
    twin = next(rl.simulate(again, frames=[4]))
    np.testing.assert_array_equal(twin.range_m, frame.range_m)
    np.testing.assert_array_equal(twin.intensity_counts, frame.intensity_counts)


def test_the_source_holds_element_sets_inline():
    scenario = rl.Scenario.load("examples/tdrs_approach.toml")
    text = scenario.source.scenario
    assert "tle/tdrs.tle" not in text
    assert "1 99001U" in text
    assert rl.Scenario.loads(text).source.scenario == text
    entry = scenario.source.targets[0]
    assert len(entry.mesh_sha256) == 64
    assert len(entry.parts) == len(entry.materials) > 5


def test_the_source_knows_the_content_of_files(text, tmp_path):
    """A resumed run must not continue with another mesh under the same name."""
    import shutil

    from rso_lidar.shipped import shipped

    path = tmp_path / "craft.glb"
    written = text.replace('model    = "plate"', 'model = "craft.glb"\ncenter_of_mass_m = [0, 0, 0]')
    sources = []
    for name in ("plate", "sphere"):
        shutil.copy(shipped(f"models/{name}.glb"), path)
        sources.append(rl.Scenario.loads(written, folder=tmp_path).source.scenario)
    assert sources[0] != sources[1]
    assert "SHA-256" in sources[0]


def test_dumps_is_loaded_again(text):
    scenario = rl.Scenario.loads(text)
    again = rl.Scenario.loads(scenario.dumps())
    assert again.dumps() == scenario.dumps()
    assert again.lidar == scenario.lidar


class TestAdvice:
    @pytest.mark.parametrize(
        ("settings", "words"),
        [
            (("time.start_utc=2025-06-01T12:00:00Z",), "days from its epoch"),
            (("follower.motion.position_m=[0, -30000, 0]",), "hill: the separation"),
            (("follower.motion.position_m=[0, -30000, 0]",), "armed window"),
            (('ptu.point={ type = "fixed", pan_deg = 90.0 }',), "never in the field of view"),
            (
                (
                    "target=[]",
                    'ptu.point={ type = "fixed" }',
                    'follower.motion={ type = "tle", file = "tle/tdrs.tle" }',
                ),
                "no [[target]]",
            ),
        ],
    )
    def test_what_is_probably_not_meant(self, settings, words):
        settings = ("time.frame_rate_hz=0.02", *settings)
        lines = rl.Scenario.load("examples/tdrs_approach.toml", settings).advice()
        assert any(words in line for line in lines), lines

    def test_light_time(self):
        settings = ("follower.motion.velocity_m_s=[0, 1200, 0]", "time.duration_s=5", "time.frame_rate_hz=1")
        lines = rl.Scenario.load("examples/tdrs_approach.toml", settings).advice()
        # 1.2 km/s times 3 km over the speed of light is 1.2 cm.
        assert any("light time" in line and "1.2 cm" in line for line in lines), lines


def test_description_is_short_and_full():
    lines = rl.Scenario.load("examples/tdrs_approach.toml").describe().splitlines()
    assert 12 <= len(lines) <= 25
    text = "\n".join(lines)
    for words in ["42165", "IFOV 340.9", "photons", "P(detect)", "3000.0 -> 304.9", "540 frames"]:
        assert words in text, words


def test_a_lidar_at_its_target_is_described_and_flown(text):
    """Nothing that physics allows is an exception: the lidar may stand in the middle of the plate."""
    scenario = rl.Scenario.loads(
        text.replace("[1000, 0, 0]", "[0, 0, 0]").replace('{ type = "track", at = "plate" }', '{ type = "fixed" }')
    )
    assert "at the target's origin" in scenario.describe()
    assert next(rl.simulate(scenario, frames=[0])).range_m.shape == (32, 32)


def test_no_more_pixels_can_report_a_target_than_there_are(text):
    with pytest.raises(ScenarioError, match=r"finding\.pixels: 1025 is more than the 1024 pixels of the receiver"):
        rl.Scenario.loads(text, settings=("finding.pixels=1025",))
    assert rl.Scenario.loads(text, settings=("finding.pixels=1024",)).finding.pixels == 1024
