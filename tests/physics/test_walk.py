"""The whole walk, from a scenario to a frame: chains of axes, sides of the picture, budgets and determinism."""

import datetime
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar.simulation import flash
from tests.optics.bench_for_tests import box, plate, write_stl

LENS = rl.Receiver(fov_deg=4.0, f_number=2.8, n_rows=32, n_cols=32, rays_per_pixel=9)
START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)


def clock(frames=12):
    return rl.Time(start_utc=START, duration_s=frames / 2, frame_rate_hz=2.0)


def fixed(*position_m):
    return rl.Fixed(position_m=tuple(float(x) for x in position_m))


def turned(rotation):
    return rl.FixedAttitude(quaternion_xyzw=tuple(float(x) for x in rotation.as_quat(canonical=True)))


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """Meshes as files: a box of 1 x 2 x 4 m, a plate of 200 m that faces along x, and a small cube."""
    folder = tmp_path_factory.mktemp("models")
    write_stl(folder / "box.stl", box(1.0, 2.0, 4.0))
    write_stl(folder / "wall.stl", np.roll(plate(200.0), 1, axis=2))
    write_stl(folder / "cube.stl", box(0.5, 0.5, 0.5))
    return folder


def local(models, targets, follower=None, lens=LENS, frames=12, **settings):
    """Return a scenario in a local world: targets (name, model, position, rotation)."""
    return rl.Scenario(
        version=1,
        name="bench",
        seed=5,
        world=rl.World(axes="local"),
        time=clock(frames),
        target=tuple(
            rl.Target(
                name=name, model=str(models / model), motion=motion, attitude=attitude, center_of_mass_m=(0.0, 0.0, 0.0)
            )
            for name, model, motion, attitude in targets
        ),
        follower=follower or rl.Follower(motion=fixed(0, 0, 0)),
        lidar=rl.Lidar(receiver=lens, laser=rl.Laser(divergence_deg=4.0), **settings.pop("lidar", {})),
        **settings,
    )


def first(scenario, **settings):
    return next(iter(rl.simulate(scenario, **settings)))


def test_ahead_left_and_up_of_the_follower(models):
    """Body x forward, y left, z up; columns grow to the right and rows grow down (REP-103 both)."""
    for (y, z), (row_side, col_side) in {
        (3, 3): (-1, -1),
        (-3, 3): (-1, 1),
        (3, -3): (1, -1),
        (-3, -3): (1, 1),
    }.items():
        labels = first(local(models, [("cube", "cube.stl", fixed(200, y, z), turned(Rotation.identity()))])).labels
        row, col = np.nonzero(labels.target == 0)
        assert len(row) > 0
        # 3 m at 200 m is 0.859 degrees: tan is 0.215 of the half field of 16 pixels.
        expected = 16 * (3 / 200) / math.tan(math.radians(2.0))
        assert np.average(row, weights=labels.photons[row, col]) + 0.5 - 16 == pytest.approx(
            row_side * expected, abs=0.3
        )
        assert np.average(col, weights=labels.photons[row, col]) + 0.5 - 16 == pytest.approx(
            col_side * expected, abs=0.3
        )


def test_the_chain_of_axes_is_equation_5(models, validation):
    """A cube seen through follower, PTU and two mounts: its place in lidar axes by 4 x 4 matrices written out here."""
    ptu = rl.Ptu(
        mount=rl.Mount(position_m=(0.3, -0.1, 0.5), euler_zyx_deg=(4.0, -3.0, 2.0)),
        point=rl.FixedPoint(pan_deg=5.0, tilt_deg=-4.0),
        response=rl.Ideal(),
    )
    mount = rl.Mount(position_m=(0.05, 0.02, 0.1), euler_zyx_deg=(-0.5, 0.4, 10.0))
    body = Rotation.from_euler("ZYX", [30.0, 10.0, -20.0], degrees=True)

    def matrix(rotation, position=(0.0, 0.0, 0.0)):
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = rotation.as_matrix(), position
        return m

    def rz(deg):
        return Rotation.from_rotvec([0, 0, math.radians(deg)])

    def ry(deg):
        return Rotation.from_rotvec([0, math.radians(deg), 0])

    def rx(deg):
        return Rotation.from_rotvec([math.radians(deg), 0, 0])

    inertial_from_follower = matrix(body, (100.0, 20.0, -5.0))
    follower_from_ptu = matrix(rz(4) * ry(-3) * rx(2), (0.3, -0.1, 0.5)) @ matrix(rz(5.0) * ry(4.0))
    carrier_from_lidar = matrix(rz(-0.5) * ry(0.4) * rx(10), (0.05, 0.02, 0.1))
    optical = np.eye(4)
    optical[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]  # x of the mount is +z of the lens, y left is -x, z up is -y
    inertial_from_lidar = inertial_from_follower @ follower_from_ptu @ carrier_from_lidar @ optical
    where = inertial_from_lidar @ [1.5, -2.0, 150.0, 1.0]
    scenario = local(
        models,
        [("cube", "cube.stl", fixed(*where[:3]), turned(Rotation.identity()))],
        follower=rl.Follower(motion=fixed(100, 20, -5), attitude=turned(body)),
        ptu=ptu,
        lidar={"mount": mount},
    )
    frame = first(scenario)
    seen = frame.truth.pose("lidar", "cube").translation
    for axis, name in enumerate("xyz"):
        validation(
            case=f"cube through follower, PTU and mounts: {name} in lidar axes",
            source="Fuller et al., eq. 5 in 4 x 4 matrices",
            expected=[1.5, -2.0, 150.0][axis],
            got=seen[axis],
            tolerance=1e-10,
            unit="m",
        )
    row, col = np.nonzero(frame.labels.target == 0)
    per_pixel = 16 / math.tan(math.radians(2.0))
    light = frame.labels.photons[row, col]
    assert np.average(col, weights=light) + 0.5 - 16 == pytest.approx(1.5 / 150 * per_pixel, abs=0.3)
    assert np.average(row, weights=light) + 0.5 - 16 == pytest.approx(-2.0 / 150 * per_pixel, abs=0.3)


@pytest.mark.slow
def test_a_wall_in_a_scenario_is_what_the_link_budget_says(models, validation):
    """From a scenario to photons on a pixel: Fuller et al., eq. 7 with the 4, on the axis, at 3 km and 2.5 degrees."""
    lens = rl.Receiver(fov_deg=2.5, f_number=2.8)
    scenario = local(models, [("wall", "wall.stl", fixed(3000, 0, 0), turned(Rotation.identity()))], lens=lens)
    scenario = scenario.replace(lidar=scenario.lidar.replace(laser=rl.Laser()))
    photons = first(scenario).labels.photons
    energy = 0.050 * 1064e-9 / (6.62607015e-34 * 299792458.0)
    aperture_m = 128 * 100e-6 / (2 * math.tan(math.radians(1.25))) / 2.8
    ifov = 2 * math.tan(math.radians(1.25)) / 128
    area = math.pi * aperture_m**2 / 4
    by_hand = energy / (4 * 3000**2 * math.tan(math.radians(1.25)) ** 2) * 0.30 / math.pi * area * ifov**2 * 0.67
    validation(
        case="wall at 3 km in a scenario, pixel on the axis",
        source="Fuller et al., eq. 7 with the 4, by hand",
        expected=by_hand,
        got=photons[64, 64],
        tolerance=1e-4 * by_hand,
        unit="photons",
    )
    assert "1,001 photons" in scenario.describe()


def test_noise_of_a_walk_is_the_detector_s(models, validation):
    """A wall of mean photons 1.1 to 1.2 thousand in every pixel: found and ranged as the closed forms say."""
    wide = rl.Empirical(false_alarms_per_s=0.0)
    scenario = local(
        models,
        [("wall", "wall.stl", fixed(1000, 0, 0), turned(Rotation.identity()))],
        frames=8,
        lidar={"detector": wide},
    )
    energy = scenario.lidar.laser.energy_mj * 1000.0 / float(first(scenario).labels.photons[16, 16])
    laser = rl.Laser(divergence_deg=4.0, energy_mj=energy)
    scenario = scenario.replace(lidar=scenario.lidar.replace(laser=laser))
    found, off, n = 0, [], 0
    for frame in rl.simulate(scenario):
        found += int(frame.valid.sum())
        n += frame.valid.size
        off.append((frame.range_m - frame.labels.range_m)[frame.valid])
    expected = float(wide.detection_probability(np.array(1000.0)))
    off = np.concatenate(off)
    validation(
        case="1000 photons in every pixel: share found",
        source="Fuller et al., sec. 3.3: 95 % at 1000 photons",
        # cos^4 falls by 0.12 % from axis to corner, 0.06 % on the mean: 0.0003 of the 95 %
        expected=0.95,
        got=found / n,
        tolerance=4 * math.sqrt(0.05 * 0.95 / n) + 4e-4,
        unit="1",
    )
    sigma = float(wide.range_noise_m(np.array(1000.0), 8e-9))
    validation(
        case="1000 photons in every pixel: range noise",
        source="shot and amplifier noise",
        expected=sigma,
        got=off.std(),
        tolerance=4 * sigma / math.sqrt(2 * len(off)) + 1e-3 * sigma,
        unit="m",
    )
    assert expected == pytest.approx(0.95, abs=1e-9)


def spinning(models, **settings):
    targets = [
        ("box", "box.stl", fixed(300, 1, 2), rl.Spin(axis=(0.3, 0.2, 1.0), rate_deg_s=20.0)),
        ("wall", "wall.stl", fixed(340, 0, 60), turned(Rotation.from_rotvec([0, 0.9, 0]))),
    ]
    # Four bands of rays at least, so that there is something for threads to share.
    return local(models, targets, lens=LENS.replace(n_rows=96, n_cols=96), **settings)


def bits(frame):
    """Return everything that a frame says, as bytes."""
    labels, reading = frame.labels, frame.observation.reading
    names = (
        "range_m",
        "first_range_m",
        "cluster_count",
        "target",
        "part",
        "facet",
        "cos_incidence",
        "photons",
        "filled_fraction",
    )
    said = [getattr(labels, name).tobytes() for name in names]
    return said + [getattr(reading, name).tobytes() for name in ("range_m", "intensity_counts", "saturated")]


@pytest.fixture(scope="module")
def flown(models):
    """A scenario with noise on every pixel, and the bits of its twelve frames."""
    scenario = spinning(models)
    assert len(first(scenario, keep=["rays"]).kept["rays"].pixel) > 3 * 16_384
    return scenario, [bits(frame) for frame in rl.simulate(scenario, threads=1)]


@pytest.mark.parametrize("threads", [2, 5, None])
def test_threads_change_no_bit(flown, threads):
    scenario, expected = flown
    assert [bits(frame) for frame in rl.simulate(scenario, threads=threads)] == expected


@pytest.mark.parametrize("frames", [slice(5, None), slice(0, 12, 3), [11], [2, 3, 9], range(1, 12, 5)])
def test_any_choice_of_frames_is_the_same_frames(flown, frames):
    scenario, expected = flown
    made = list(rl.simulate(scenario, frames=frames))
    numbers = list(range(12))[frames] if isinstance(frames, slice) else list(frames)
    assert [frame.index for frame in made] == numbers
    assert [bits(frame) for frame in made] == [expected[k] for k in numbers]


def test_frames_in_any_order_and_again(flown):
    scenario, expected = flown
    for k in (7, 0, 11, 7, 3):
        assert bits(first(scenario, frames=[k])) == expected[k]


def test_a_rebuilt_scenario_flies_the_same(flown):
    """What a frame carries of its source is enough to fly it again."""
    scenario, expected = flown
    again = rl.Scenario.loads(scenario.source.scenario)
    assert bits(first(again, frames=[4])) == expected[4]


def test_every_frame_and_seed_has_noise_of_its_own(flown):
    scenario, expected = flown
    assert len({frame[9] for frame in expected}) == 12
    other = first(scenario.replace(seed=6), frames=[4])
    assert bits(other)[9] != expected[4][9], "another seed, another reading"
    assert bits(other)[:9] == expected[4][:9], "and the same truth"


def test_flash_by_hand_is_the_frame(flown):
    scenario, expected = flown
    frame = first(scenario, frames=[6])
    again = flash(scenario, frame.truth, scenario.rng(6), index=6)
    assert bits(again) == expected[6]


def test_neighbouring_frames_do_not_share_noise(models):
    """The same scene at all times: correlations of the range noise of frames are those of chance."""
    wall = [("wall", "wall.stl", fixed(300, 0, 0), turned(Rotation.identity()))]
    scenario = local(models, wall, frames=6)
    noise = np.array([(f.range_m - f.labels.range_m).ravel() for f in rl.simulate(scenario)])
    correlation = np.corrcoef(noise) - np.eye(6)
    assert np.abs(correlation).max() < 5 / math.sqrt(noise.shape[1])
    pixels = np.corrcoef(noise[:, :-1].ravel(), noise[:, 1:].ravel())[0, 1]
    assert abs(pixels) < 5 / math.sqrt(noise.size)


@pytest.mark.parametrize("bad", [0, -1])
def test_a_number_of_threads_that_cannot_be_gets_one_line(models, bad):
    with pytest.raises(rl.ScenarioError):
        first(spinning(models), threads=bad)


@pytest.mark.parametrize("frames", [[], [12], [-1], [3, 3], [5, 2]])
def test_a_choice_of_frames_that_cannot_be(models, frames):
    with pytest.raises(rl.ScenarioError, match="frames: "):
        list(rl.simulate(spinning(models), frames=frames))


def test_nothing_that_physics_allows_is_an_exception(models):
    """Targets behind, beside, about and far from the lidar, and none at all."""
    for where in [(-300, 0, 0), (0, 300, 0), (0, 0, 0), (0.6, 0, 0), (5e7, 0, 0), (1e-3, 0, 0)]:
        frame = first(local(models, [("box", "box.stl", fixed(*where), turned(Rotation.identity()))]))
        assert frame.range_m.shape == (32, 32)
    assert np.all(first(local(models, [])).labels.target == -1)
