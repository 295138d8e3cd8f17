"""The walk as a whole: the same frames however they are asked for, and the one way back that there is."""

import datetime

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar import optics, scene
from rso_lidar.detector import detect
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import truth
from rso_lidar.simulation import DETECTION, flash


@pytest.fixture(scope="module")
def scenario():
    settings = ("lidar.receiver.n_rows=32", "lidar.receiver.n_cols=32", "time.frame_rate_hz=0.01")
    return rl.Scenario.load("examples/tdrs_approach.toml", settings)


def same(a, b):
    for name in ("range_m", "intensity_counts", "saturated"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    for name in ("range_m", "photons", "facet", "cos_incidence"):
        np.testing.assert_array_equal(getattr(a.labels, name), getattr(b.labels, name))
    np.testing.assert_array_equal(a.truth.pose("lidar", "tdrs").as_matrix(), b.truth.pose("lidar", "tdrs").as_matrix())
    np.testing.assert_array_equal(a.truth.pointing.measured_rad, b.truth.pointing.measured_rad)


def test_a_frame_is_the_same_alone_in_a_slice_and_with_any_threads(scenario):
    whole = list(rl.simulate(scenario, threads=2))
    assert [frame.index for frame in whole] == list(range(27))
    same(next(rl.simulate(scenario, frames=[20], threads=1)), whole[20])
    for frame in rl.simulate(scenario, frames=slice(24, None), threads=5):
        same(frame, whole[frame.index])


def test_a_frame_holds_what_it_says(scenario):
    frame = next(rl.simulate(scenario, frames=[26], keep=("rays", "hits", "photons")))
    assert frame.range_m.shape == frame.intensity_counts.shape == frame.valid.shape == (32, 32)
    assert frame.points_m.shape == (32, 32, 3)
    np.testing.assert_allclose(
        np.linalg.norm(frame.points_m[frame.valid], axis=1), frame.range_m[frame.valid], rtol=1e-6
    )
    assert np.isnan(frame.range_m[~frame.valid]).all()
    assert (frame.intensity_counts[frame.valid] >= 1).all()
    assert (frame.intensity_counts[~frame.valid] == 0).all()
    assert set(frame.kept) == {"rays", "hits", "photons"}
    with pytest.raises(ValueError, match="read-only"):
        frame.range_m[0, 0] = 1.0


def test_a_pose_goes_through_the_tree_in_the_order_of_equation_5(scenario):
    truth = next(rl.simulate(scenario, frames=[9])).truth
    chain = (
        truth.pose("lidar", "ptu")
        * truth.pose("ptu", "follower")
        * truth.pose("follower", "inertial")
        * truth.pose("inertial", "tdrs")
    )
    # Through inertial coordinates float64 is 7 nm coarse at 42,000 km, and a rotation of 1e-16 moves as much: 0.1 um in all.
    np.testing.assert_allclose(truth.pose("lidar", "tdrs").as_matrix(), chain.as_matrix(), atol=1e-7)


def test_rates_are_the_change_of_the_pose(scenario):
    fine = scenario.replace(time=scenario.time.replace(frame_rate_hz=100.0, duration_s=0.1), ptu=None)
    before, now, after = (frame.truth for frame in rl.simulate(fine, frames=[3, 4, 5]))
    velocity, turning = now.rates("lidar", "tdrs")
    moved = after.pose("lidar", "tdrs").translation - before.pose("lidar", "tdrs").translation
    np.testing.assert_allclose(velocity, moved / 0.02, atol=1e-6)  # 20 nm over 20 ms
    turned = (before.pose("lidar", "tdrs").rotation.inv() * after.pose("lidar", "tdrs").rotation).as_rotvec()
    # rtn turns with r x v / r², by convention; the slow turn of a geosynchronous orbit's plane, 1e-9 rad/s, is left out.
    np.testing.assert_allclose(turning, turned / 0.02, atol=3e-9)


class TestController:
    def test_it_sees_no_truth_and_commands_the_next_flash(self, scenario):
        fast = scenario.replace(
            time=scenario.time.replace(frame_rate_hz=10.0, duration_s=0.5),
            ptu=scenario.ptu.replace(response=rl.Ideal()),
        )
        seen = []

        def controller(observation):
            seen.append(observation)
            assert not hasattr(observation, "truth")
            assert not hasattr(observation, "labels")
            return rl.Command(pan_rad=0.01 * len(seen))

        frames = list(rl.simulate(fast, controller=controller))
        assert len(seen) == 5
        pans = [frame.truth.pointing.actual_rad[0] for frame in frames]
        np.testing.assert_allclose(pans[1:], [0.01, 0.02, 0.03, 0.04], atol=1e-12)
        open_loop = list(rl.simulate(fast))
        same(frames[0], open_loop[0])
        # What is not commanded keeps the scenario's demand.
        np.testing.assert_allclose(
            [frame.truth.pointing.actual_rad[1] for frame in frames],
            [frame.truth.pointing.actual_rad[1] for frame in open_loop],
            atol=1e-12,
        )

    def test_with_a_choice_of_frames_it_is_refused(self, scenario):
        with pytest.raises(ScenarioError, match="controller"):
            rl.simulate(scenario, controller=lambda _: None, frames=[3])

    def test_without_a_ptu_there_is_nothing_to_command(self, scenario):
        bare = scenario.replace(ptu=None)
        with pytest.raises(ScenarioError, match=r"\[ptu\]"):
            list(rl.simulate(bare, controller=lambda _: rl.Command(pan_rad=0.0)))
        assert len(list(rl.simulate(bare.replace(time=bare.time.replace(duration_s=200.0)), lambda _: None))) == 2


@pytest.mark.parametrize("frames", [[27], [-1], [3, 3], [5, 4], [], slice(30, 40)])
def test_frames_that_are_not_there(scenario, frames):
    with pytest.raises(ScenarioError, match="0 to 26"):
        rl.simulate(scenario, frames=frames)


def test_unknown_records_to_keep(scenario):
    with pytest.raises(ScenarioError, match=r"known: .*waveforms"):
        rl.simulate(scenario, keep=["wave"])
    fast = scenario.replace(lidar=scenario.lidar.replace(detector=rl.Empirical()))
    with pytest.raises(ScenarioError, match=r"lidar.detector.type = .gsfl."):
        rl.simulate(fast, keep=["waveforms"])


def test_no_target_is_no_error(scenario):
    settings = ("target=[]", 'ptu.point={ type = "fixed" }', 'follower.motion={ type = "tle", file = "tle/tdrs.tle" }')
    empty = rl.Scenario.load("examples/tdrs_approach.toml", (*settings, "time.duration_s=10"))
    (frame,) = list(rl.simulate(empty, frames=[0]))
    assert (frame.labels.target == -1).all()


ORBIT = rl.Kepler(
    epoch_utc=datetime.datetime(2024, 9, 17, 11, tzinfo=datetime.UTC),
    semi_major_axis_km=7000,
    eccentricity=0.004,
    inclination_deg=98,
    raan_deg=10,
    argument_of_perigee_deg=20,
    true_anomaly_deg=30,
)
MOTIONS = {
    "tle": rl.Tle(file="tle/flyby.tle", norad_id=99002),
    "kepler": ORBIT,
    "state": rl.orbit.State(
        epoch_utc=datetime.datetime(2024, 9, 17, 11, tzinfo=datetime.UTC),
        position_m=(7e6, 1e5, 2e5),
        velocity_m_s=(10, 7500, 300),
    ),
    "hill": rl.Hill(relative_to="chief", position_m=(10, -100, 20), velocity_m_s=(0.01, 0.1, 0.02)),
    "fixed": rl.Fixed(position_m=(1, 2, 3), relative_to="chief"),
}
ATTITUDES = {
    "none": None,
    "fixed": rl.FixedAttitude(euler_zyx_deg=(10, 20, 30)),
    "rtn": rl.Rtn(euler_zyx_deg=(10, 20, 30)),
    "lvlh_ccsds": rl.motion.LvlhCcsds(euler_zyx_deg=(10, 20, 30)),
    "look_at": rl.LookAt(at="other"),
    "spin": rl.Spin(axis=(1, 2, 3), rate_deg_s=3),
    "tumble": rl.Tumble(inertia_kg_m2=(1, 2, 2.5), body_rate_deg_s=(1, 5, 0.1)),
}


# A body that does not orbit has no rtn axes.
@pytest.mark.parametrize(
    ("motion", "attitude"),
    [(m, a) for m in MOTIONS for a in ATTITUDES if m != "fixed" or a not in ("rtn", "lvlh_ccsds")],
)
def test_an_epoch_has_the_same_bits_alone_and_among_many(motion, attitude):
    """Frame k depends on (scenario, seed, k) only: so must every pose and rate, whatever a library does with batches."""
    bodies = [
        rl.motion.Body(name="chief", motion=ORBIT, attitude=rl.Rtn()),
        rl.motion.Body(
            name="other", motion=rl.Hill(relative_to="chief", position_m=(5, 300, -7), velocity_m_s=(0, 0, 0))
        ),
        rl.motion.Body(name="body", motion=MOTIONS[motion], attitude=ATTITUDES[attitude]),
    ]
    epochs = rl.orbit.Epochs(datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC), np.arange(50) * 7.3)
    course = truth(bodies, epochs)
    for k in (0, 17, 49):
        alone, among = truth(bodies, epochs.at([k])).at(0), course.at(k)
        for name in among.poses:
            one, many = alone.poses.link("chief", name), among.poses.link("chief", name)
            np.testing.assert_array_equal(one.pose.as_matrix(), many.pose.as_matrix(), err_msg=name)
            np.testing.assert_array_equal(one.velocity_m_s, many.velocity_m_s, err_msg=name)
            np.testing.assert_array_equal(one.angular_velocity_rad_s, many.angular_velocity_rad_s, err_msg=name)
        np.testing.assert_array_equal(alone.sun_direction, among.sun_direction)
        np.testing.assert_array_equal(alone.states["body"].velocity_m_s, among.states["body"].velocity_m_s)


# ----------------------------------------------------------------- an instrument that changes, and kept records

PLAN = (
    "lidar.schedule={time_s=[0, 1.8], focal_length_mm=[70, 110], divergence_deg=[2.5, 2.0], energy_mj=[50, 5], "
    "gate_delay_ns=[6640, 6649]}"
)
CHANGING = ("lidar.detector.gate={delay_ns=6640, width_ns=60}", "lidar.laser.energy_jitter_fraction=0.05", PLAN)


@pytest.fixture
def changing(text):
    return rl.Scenario.loads(text, settings=CHANGING)


class TestPlan:
    def test_every_frame_records_what_was_in_force(self, changing):
        for frame in rl.simulate(changing, frames=[0, 3, 9]):
            done = frame.time_s / 1.8
            settings = frame.observation.settings
            assert settings["focal_length_m"] == pytest.approx(0.070 + 0.040 * done, rel=1e-12)
            assert settings["laser_divergence_rad"] == pytest.approx(np.radians(2.5 - 0.5 * done), rel=1e-12)
            # As set: by how much a single pulse differs the spacecraft does not know.
            assert settings["laser_energy_j"] == pytest.approx(0.050 - 0.045 * done, rel=1e-12)
            assert settings["gate_delay_s"] == pytest.approx(6640e-9 + 9e-9 * done, rel=1e-12)
            assert settings["gate_width_s"] == pytest.approx(60e-9, rel=1e-12)
            edge = frame.line_of_sight[0, 0]
            assert edge[0] / edge[2] == pytest.approx(-15.5 * 100e-6 / settings["focal_length_m"], rel=1e-12)

    def test_a_frame_is_the_same_alone_and_with_any_threads(self, changing):
        keep = ("waveforms", "photons")
        whole = list(rl.simulate(changing, threads=2, keep=keep))
        for numbers, threads in (([7], 1), ([2, 7], 3), (slice(6, None), 5)):
            for frame in rl.simulate(changing, frames=numbers, threads=threads, keep=keep):
                among = whole[frame.index]
                assert frame.observation.settings == among.observation.settings
                np.testing.assert_array_equal(frame.range_m, among.range_m)
                np.testing.assert_array_equal(frame.intensity_counts, among.intensity_counts)
                np.testing.assert_array_equal(frame.line_of_sight, among.line_of_sight)
                np.testing.assert_array_equal(frame.labels.photons, among.labels.photons)
                one, many = frame.kept["waveforms"], among.kept["waveforms"]
                np.testing.assert_array_equal(one.samples_counts, many.samples_counts)

    def test_zoom_makes_the_target_larger(self, text):
        """A plate of 16 m² covers (f / pitch / range)² x 16 pixels: 7.84 at 70 mm, 23.04 at 120 mm."""
        zoom = ('lidar.schedule={time_s=[0, 1], focal_length_mm=[70, 120], interpolation="step"}',)
        near, far = rl.simulate(rl.Scenario.loads(text, settings=zoom), frames=[0, 5])
        covered = [frame.labels.filled_fraction.sum() for frame in (near, far)]
        # Spin turns the plate by 10 degrees in that second; a grid of 2 x 2 rays, made finer, knows an edge to some percent.
        assert covered[0] == pytest.approx(7.84, rel=0.05)
        assert covered[1] == pytest.approx(23.04 * np.cos(np.radians(10)), rel=0.05)

    def test_a_gate_sees_what_is_in_it(self, text):
        """The gate opens behind the plate for frames from 1 s on."""
        gate = (
            "lidar.detector.gate={delay_ns=6640, width_ns=60, false_alarm_probability=1e-6}",
            'lidar.schedule={time_s=[0, 1], gate_delay_ns=[6640, 7000], interpolation="step"}',
        )
        for frame in rl.simulate(rl.Scenario.loads(text, settings=gate)):
            on_target = frame.labels.filled_fraction > 0.99
            assert on_target.any()
            assert frame.valid[on_target].all() == (frame.time_s < 1.0)
            assert not (frame.valid[on_target].any() and frame.time_s >= 1.0)


class TestCommands:
    """What a controller asks of the instrument acts from the next flash on, and is recorded there."""

    @pytest.mark.parametrize(
        ("command", "name"),
        [
            (rl.Command(focal_length_m=0.1), "focal_length_m"),
            (rl.Command(divergence_rad=0.02), "laser_divergence_rad"),
            (rl.Command(energy_j=0.01), "laser_energy_j"),
            (rl.Command(gate_delay_s=6.645e-6), "gate_delay_s"),
        ],
    )
    def test_each(self, text, command, name):
        gated = rl.Scenario.loads(text, settings=("lidar.detector.gate={delay_ns=6640}", "time.duration_s=0.8"))
        bare = gated.replace(ptu=None)  # without a PTU they are allowed too
        for scenario in (gated, bare):
            value = next(value for value in vars(command).values() if value is not None)
            seen = []

            def controller(observation, seen=seen):
                seen.append(observation.settings[name])
                return command if len(seen) == 2 else None

            frames = list(rl.simulate(scenario, controller))
            planned = scenario.lidar.settings[name]
            assert seen == [frame.observation.settings[name] for frame in frames]
            # One command holds for one flash: None keeps the scenario's demand.
            assert seen == pytest.approx([planned, planned, value, planned], rel=1e-12)

    def test_energy_is_photons(self, text):
        scenario = rl.Scenario.loads(text, settings=("time.duration_s=0.4",)).replace(ptu=None)
        first, second = rl.simulate(scenario, lambda _: rl.Command(energy_j=0.005))
        lit = first.labels.filled_fraction > 0.99
        assert second.labels.photons[lit].mean() / first.labels.photons[lit].mean() == pytest.approx(0.1, rel=0.01)

    def test_they_come_before_the_plan(self, changing):
        frames = list(rl.simulate(changing, lambda _: rl.Command(energy_j=0.033)))
        assert [f.observation.settings["laser_energy_j"] for f in frames[1:]] == pytest.approx([0.033] * 9, rel=1e-12)
        assert frames[9].observation.settings["focal_length_m"] == pytest.approx(0.110, rel=1e-12)

    def test_a_gate_can_follow_the_range_that_it_measured(self, text):
        """A closed loop: the gate opens 20 ns before what the last frame saw, and keeps the target."""
        settings = ("lidar.detector.gate={delay_ns=6650, width_ns=60}",)
        scenario = rl.Scenario.loads(text, settings=settings)

        def follow(observation):
            return rl.Command(gate_delay_s=float(np.nanmedian(observation.reading.range_m)) * 2.0 / 299_792_458 - 20e-9)

        frames = list(rl.simulate(scenario, follow))
        assert all(frame.valid[frame.labels.filled_fraction > 0.99].all() for frame in frames)
        # The median of some sixteen returns, of 6 cm each, is good to 0.4 ns.
        delays = [frame.observation.settings["gate_delay_s"] for frame in frames[1:]]
        np.testing.assert_allclose(delays, 2000.0 / 299_792_458 - 20e-9, atol=2e-9)

    @pytest.mark.parametrize(
        ("command", "words"),
        [
            (rl.Command(energy_j=-1.0), "greater than 0"),
            (rl.Command(energy_j=float("nan")), "finite"),
            (rl.Command(energy_j="much"), "energy_j: needs a number"),
            (rl.Command(divergence_rad=4.0), "less than 180"),
            (rl.Command(focal_length_m=0.0), "greater than 0"),
            (rl.Command(gate_delay_s=1e-6), r"no gate; add \[lidar\.detector\.gate\]"),
        ],
    )
    def test_bad_ones_get_one_line(self, text, command, words):
        scenario = rl.Scenario.loads(text).replace(ptu=None)
        with pytest.raises(ScenarioError, match=words) as error:
            list(rl.simulate(scenario, lambda _: command))
        assert "\n" not in str(error.value)
        assert "command" in str(error.value)


class TestKept:
    @pytest.mark.parametrize("settings", [(), ("lidar.detector.gate={delay_ns=6640, width_ns=60}",)])
    def test_waveforms_photons_and_the_oversampled_image(self, text, settings):
        scenario = rl.Scenario.loads(text, settings=settings)
        frame = next(rl.simulate(scenario, frames=[2], keep=["waveforms", "photons", "oversampled"]))
        assert set(frame.kept) == {"waveforms", "photons", "oversampled"}
        waveforms, photons, fine = (frame.kept[name] for name in ("waveforms", "photons", "oversampled"))
        # Whatever is reported was stored.
        assert set(np.flatnonzero(frame.valid.ravel())) <= set(waveforms.pixel.tolist())
        if settings:
            assert len(waveforms.pixel) == 32 * 32
        # The image is the labels', pixel by pixel, and so is the sum of its fine cells.
        image = np.bincount(photons.pixel, photons.photons, 32 * 32).reshape(32, 32)
        np.testing.assert_allclose(image, frame.labels.photons, rtol=1e-6)
        factor = fine.photons.shape[0] // 32
        cells = fine.photons.reshape(32, factor, 32, factor).sum(axis=(1, 3))
        np.testing.assert_allclose(cells, frame.labels.photons, rtol=1e-5)
        # A plate 1000 m away that has turned by 4 degrees is 999.86 to 1000.14 m away.
        assert np.nanmin(fine.range_m) > 999.8
        assert np.nanmax(fine.range_m) < 1000.2

    def test_they_change_nothing(self, text):
        scenario = rl.Scenario.loads(text)
        bare = next(rl.simulate(scenario, frames=[2]))
        full = next(rl.simulate(scenario, frames=[2], keep=["rays", "hits", "waveforms", "oversampled"]))
        assert bare.kept == {}
        np.testing.assert_array_equal(bare.range_m, full.range_m)

    def test_one_name_may_stand_alone(self, text):
        assert set(next(rl.simulate(rl.Scenario.loads(text), keep="photons")).kept) == {"photons"}


def test_a_target_through_the_lidar_itself_is_no_error(text):
    """A facet through the lidar's own place has no range, and nothing that physics allows is an exception."""
    scenario = rl.Scenario.loads(text)
    here = scenario.follower.motion
    plate = scenario.target[0].replace(motion=here)
    frame = next(rl.simulate(scenario.replace(target=(plate,)), frames=[0], keep=("hits", "photons")))
    assert np.isfinite(frame.kept["photons"].photons).all()
    assert (frame.kept["hits"].range_m > 0.0).all()


def test_no_two_stages_or_frames_draw_from_one_stream(text, monkeypatch):
    """Two generators a frame, of pointing and of detection: none of all that a run asks for begins like another.

    What the lidar's mount does and what its pixels do are independent then; both are what their own stage's stream says.
    """
    scenario, asked, rng = rl.Scenario.loads(text), {}, rl.Scenario.rng

    def remembered(self, frame, stage=0):
        generator = rng(self, frame, stage)
        asked.setdefault(generator.bit_generator.state["state"]["key"].tobytes(), []).append((frame, stage))
        return generator

    monkeypatch.setattr(rl.Scenario, "rng", remembered)
    frames = list(rl.simulate(scenario, frames=range(3), threads=1))
    calls = [call for calls in asked.values() for call in calls]
    assert len(asked) == len(calls) == 6, "two stages or two frames share a stream"
    for frame in frames:
        stages = {stage for index, stage in calls if index == frame.index}
        assert len(stages) == 2
        made = [flash(scenario, frame.truth, rng(scenario, frame.index, stage)) for stage in sorted(stages)]
        assert sum(np.array_equal(one.range_m, frame.range_m, equal_nan=True) for one in made) == 1
        jitter = (frame.truth.pointing.actual_rad - frame.truth.pointing.measured_rad) / np.deg2rad(0.001)
        drawn = [rng(scenario, frame.index, stage).standard_normal(4) for stage in sorted(stages)]
        assert sum(np.allclose(jitter, four[:2] - four[2:], atol=1e-6) for four in drawn) == 1


def test_a_frame_chosen_has_the_jitter_of_its_number(text):
    """Frames 3 and 7, asked for alone, point and report as they do among all: by their number, not their place."""
    scenario = rl.Scenario.loads(text)
    whole = {frame.index: frame.truth.pointing for frame in rl.simulate(scenario, threads=1)}
    errors = [pointing.actual_rad - pointing.measured_rad for pointing in whole.values()]
    assert len(np.unique(errors, axis=0)) == len(whole)
    for frame in rl.simulate(scenario, frames=[3, 7], threads=1):
        np.testing.assert_array_equal(frame.truth.pointing.actual_rad, whole[frame.index].actual_rad)
        np.testing.assert_array_equal(frame.truth.pointing.measured_rad, whole[frame.index].measured_rad)


ALL_AT_ONCE = (
    'world={axes="local", sun_direction=[-1, 0.4, 0.7]}',
    "target.0.motion.position_m=[60, 0, 0]",
    "target.0.scale=1.5",
    'target.0.material={type="retro_reflector", diameter_mm=12.7, reflectance=0.8, fill_fraction=0.02, diffuse=0.2}',
    "lidar.laser.offset_m=[0.004, 0.006, -0.002]",
    "lidar.laser.energy_jitter_fraction=0.2",
    "lidar.laser.timing_jitter_ns=2",
    "lidar.receiver.filter_width_nm=2",
    "lidar.detector.max_returns=3",
    "lidar.schedule={time_s=[0, 1.8], focal_length_mm=[70, 110], energy_mj=[50, 5]}",
)


def test_each_stage_is_handed_what_the_instrument_in_force_says(text):
    """Laser aside, jittered pulse, cube corners, sunlight, zoom and several returns: the stages by hand give the frame."""
    bench = text.replace("fov_deg  = 2.5", "fov_deg  = 4")
    scenario = rl.Scenario.loads(bench, settings=ALL_AT_ONCE)
    k = 7
    frame = next(rl.simulate(scenario, frames=[k], keep=("hits", "photons")))
    lidar = scenario.instrument.at(frame.time_s)
    rng = scenario.rng(k, DETECTION)
    energy, late = rng.standard_normal(2)
    nominal = lidar.laser
    laser = nominal.replace(energy_mj=nominal.energy_mj * (1.0 + 0.2 * energy))
    assert nominal.energy_mj == pytest.approx(50.0 - 45.0 * 1.4 / 1.8)
    assert lidar.receiver.focal_length_m == pytest.approx(0.070 + 0.040 * 1.4 / 1.8)
    assert lidar.receiver.focal_length_m != pytest.approx(scenario.instrument.at(0.0).receiver.focal_length_m, rel=0.05)
    truth, surfaces = frame.truth, scenario.surfaces
    rays = optics.pixel_rays(lidar.receiver, laser, scene.extent(surfaces, truth))
    hits = scene.cast(
        rays,
        surfaces,
        truth,
        1,
        laser_from_m=np.array([0.004, 0.006, -0.002]),
        sun=True,
        aperture_m=lidar.receiver.aperture_m,
    )
    photons = optics.collect(hits, laser, lidar.receiver, late * 2e-9)
    reading, _ = detect(photons, lidar.detector, rng)
    for name in ("cos_incidence", "brdf_per_sr", "sunlight_per_sr"):
        np.testing.assert_array_equal(getattr(frame.kept["hits"], name), getattr(hits, name))
    assert frame.kept["photons"].late_s == late * 2e-9
    np.testing.assert_array_equal(frame.kept["photons"].photons, photons.photons)
    np.testing.assert_array_equal(frame.kept["photons"].background_photons_per_s, photons.background_photons_per_s)
    for name in ("range_m", "intensity_counts", "saturated", "return_range_m", "return_intensity_counts"):
        np.testing.assert_array_equal(getattr(frame.observation.reading, name), getattr(reading, name))
    assert frame.labels.return_range_m.shape == (*frame.range_m.shape, 3)
    assert frame.observation.settings == lidar.settings
    # And each of these matters here: without it the light is another.
    other = scene.cast(rays, surfaces, truth, 1, sun=True, aperture_m=lidar.receiver.aperture_m)
    assert not np.allclose(other.brdf_per_sr, hits.brdf_per_sr, rtol=1e-3)
    point = scene.cast(rays, surfaces, truth, 1, laser_from_m=laser.offset, sun=True, aperture_m=0.0)
    assert not np.allclose(point.brdf_per_sr, hits.brdf_per_sr, rtol=1e-3)
    assert hits.sunlight_per_sr.max() > 0.0
    measured, actual = frame.observation.pan_tilt_rad, truth.pointing.actual_rad
    assert np.array_equal(measured, truth.pointing.measured_rad) and not np.array_equal(measured, actual)
