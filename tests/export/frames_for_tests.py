"""Frames made of random numbers, for tests that need no simulator."""

import contextlib
import dataclasses
import os
import shutil
import tempfile
from functools import lru_cache
from pathlib import Path

import h5py
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from rso_lidar import export
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import (
    BodyState,
    Frame,
    GyroSamples,
    Labels,
    Observation,
    Oversampled,
    Photons,
    PixelPrediction,
    PtuAngles,
    Reading,
    SensorSamples,
    Source,
    TargetEntry,
    Truth,
    Waveforms,
    WheelSamples,
    array,
)

PARENTS = {
    "tdrs": "inertial",
    "tdrs.rtn": "inertial",
    "follower": "tdrs.rtn",
    "ptu": "follower",
    "lidar": "ptu",
}
SOURCE = Source(
    scenario='version = 1\nname = "Hügel"\n' + "# element set\n" * 20,
    title="TDRS hop, 3 km to 300 m",
    start_utc="2024-09-17T12:00:00Z",
    seed=20240917,
    versions={"rso_lidar": "0.1.0", "numpy": "2.4.6"},
    targets=(
        TargetEntry("tdrs", "tdrs", "ab" * 32, ("bus", "solar_array"), ("lambertian 0.3", "phong"), 4000),
        TargetEntry("rock", "asteroid", "cd" * 32, ("body",), ("lambertian 0.1",), 12),
    ),
)


KEEP = ("waveforms", "photons", "oversampled", "prediction")
RETURNS, SAMPLES, FINER = 3, 20, 4


def line_of_sight(shape, zoom=1.0):
    rows, cols = np.meshgrid(np.arange(shape[0]), np.arange(shape[1]), indexing="ij")
    deep = np.full(shape, 20.0 * shape[0] * zoom)
    sight = np.stack([cols - shape[1] / 2 + 0.5, rows - shape[0] / 2 + 0.5, deep], axis=-1)
    return sight / np.linalg.norm(sight, axis=-1, keepdims=True)


_SIGHT = {}


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class FourSamples(SensorSamples):
    """Samples of a sensor with fields of four types."""

    current_a: np.ndarray = array("sample diode row", "f4", "A", "currents of six photodiodes")
    code: np.ndarray = array("sample", "i2", "1", "state of the sensor")
    is_lit: np.ndarray = array("sample diode", "?", "1", "whether a photodiode is lit")
    extra: np.ndarray | None = array("sample", "f8", "V", "a voltage that this sensor has not", optional=True)


SENSORS = {"gyro": (1, 5, 6, 5), "wheels": (0, 0, 2, 2), "own sensor": (0, 1, 0, 1)}  # samples in frames 0, 1, 2, …


def make_sensors(k, rng, counts):
    """Return the samples of three sensors in frame k, `counts` of each in the first frames, and then the last of them."""
    found = {}
    for name, of_frames in counts.items():
        n = of_frames[min(k, len(of_frames) - 1)]
        time_s = 0.1 * (k - 1) + 0.1 * np.arange(1, n + 1) / max(n, 1)
        common = time_s - 0.01, time_s, rng.uniform(size=n) < 0.7
        if name == "gyro":
            rates = rng.normal(size=(n, 3))
            rates[~common[2]] = np.nan  # as in an outage
            found[name] = GyroSamples(*common, rates)
        elif name == "wheels":
            found[name] = WheelSamples(*common, rng.normal(size=(n, 4)), np.empty((n, 0)))
        else:
            code = rng.integers(-100, 100, n)
            found[name] = FourSamples(*common, rng.normal(size=(n, 2, 3)), code, rng.uniform(size=(n, 2)) < 0.5)
    return found


def make_frame(k=0, seed=1, shape=(12, 10), **how):
    """Return frame k of a made-up run; the same for the same arguments. See `_make_frame` for the others.

    Frames cannot be changed, so that tests which make the same ones again share them.
    """
    plain = how.keys() <= {"ptu", "lit", "returns", "keep"}
    return (_make_frame_once if plain else _make_frame)(k, seed, tuple(shape), **how)


def _make_frame(
    k=0,
    seed=1,
    shape=(12, 10),
    *,
    ptu=True,
    source=SOURCE,
    lit=0.2,
    settings=None,
    returns=False,
    keep=(),
    zoom=1.0,
    sensors=None,
):
    """Make frame k of a made-up run. `zoom` is a number, or a function of k."""
    rng = np.random.default_rng([seed, k])
    zoom = zoom(k) if callable(zoom) else zoom
    sight = line_of_sight(shape, zoom) if zoom != 1.0 else _SIGHT.setdefault(shape, line_of_sight(shape))
    valid = np.zeros(shape, bool)
    side = [max(1, round(lit**0.5 * size)) for size in shape]
    valid[: side[0], : side[1]] = True
    noise = rng.uniform(0, 1, shape)

    def sky(values, absent):
        return np.where(valid, values, absent)

    reading = Reading(
        range_m=sky(300 + noise, np.nan),
        intensity_counts=sky(rng.integers(1, 4096, shape), 0),
        saturated=sky(noise > 0.9, 0),
    )
    labels = Labels(
        range_m=sky(300 + noise, np.nan),
        first_range_m=sky(299 + noise, np.nan),
        cluster_count=sky(1 + (noise > 0.8), 0),
        target=sky(rng.integers(0, 2, shape), -1),
        part=sky(rng.integers(0, 2, shape), -1),
        facet=sky(rng.integers(0, 4000, shape), -1),
        cos_incidence=sky(noise, np.nan),
        photons=sky(1000 * noise, 0),
        filled_fraction=sky(noise, 0),
    )
    if returns:
        some = np.arange(RETURNS) < labels.cluster_count[..., None]
        many = rng.uniform(0, 1, (*shape, RETURNS))
        reading = dataclasses.replace(
            reading,
            return_range_m=np.where(some, 300 + many, np.nan),
            return_intensity_counts=np.where(some, np.rint(1 + 4094 * many), 0),
        )
        labels = dataclasses.replace(
            labels, return_range_m=np.where(some, 300 + many, np.nan), return_photons=np.where(some, 1000 * many, 0)
        )
    time_s = 0.1 * k
    observation = Observation(
        time_s=time_s,
        reading=reading,
        settings={"focal_length_m": 0.2, "energy_j": 0.05} if settings is None else settings,
        line_of_sight=sight,
        pan_tilt_rad=rng.normal(size=2) if ptu else None,
        sensors=make_sensors(k, np.random.default_rng([seed, k, 7]), sensors or {}),
    )
    pointing = None
    if ptu:
        pointing = PtuAngles(rng.normal(size=2), rng.normal(size=2), observation.pan_tilt_rad, rng.normal(size=2))
    parents = {name: parent for name, parent in PARENTS.items() if ptu or name != "ptu"}
    if not ptu:
        parents["lidar"] = "follower"
    size = {"tdrs": 4.2e7, "tdrs.rtn": 4.2e7, "follower": 3e3}
    links = {
        name: Link(
            RigidTransform.from_components(size.get(name, 1) * rng.normal(size=3), Rotation.random(rng=rng)),
            rng.normal(size=3),
            rng.normal(size=3),
        )
        for name in parents
    }
    states = {name: BodyState(4.2e7 * rng.normal(size=3), 3e3 * rng.normal(size=3)) for name in ("tdrs", "follower")}
    sun = rng.normal(size=3)
    sunlit = {"tdrs": float(rng.uniform()), "follower": 1.0}
    truth = Truth(time_s, PoseTree(parents, links), states, sun / np.linalg.norm(sun), pointing, sunlit)
    kept = {name: made for name, made in make_kept(rng, shape, valid).items() if name in keep}
    return Frame(3 * k, observation, labels, truth, source, kept)


_make_frame_once = lru_cache(256)(_make_frame)


def make_kept(rng, shape, valid):
    """Return intermediate records of pixels that are lit."""
    pixel = np.flatnonzero(valid)
    count = len(pixel)
    latch_s = rng.uniform(2e-6, 3e-6, count)
    waveforms = Waveforms(
        shape, 1.25e-9, 100.0, pixel, latch_s - 8e-9, latch_s, rng.integers(0, 4096, (count, SAMPLES))
    )
    hits = np.repeat(pixel, 2)  # two returns a pixel
    photons = Photons(
        shape=shape,
        pulse_fwhm_s=8e-9,
        pulse_step_s=1e-9,
        late_s=0.0,
        pulse_power_per_s=np.array([0.0, 1e9, 0.0]),
        pixel=hits,
        delay_s=np.repeat(latch_s, 2),
        photons=rng.uniform(0, 500, 2 * count),
        depth_spread_s=np.zeros(2 * count),
        coherence_cells=np.ones(2 * count),
        hit=np.arange(2 * count),
        cluster=np.repeat(np.arange(count), 2),
        cluster_pixel=pixel,
        background_photons_per_s=rng.uniform(0, 1e6, shape),
    )
    fine = (FINER * shape[0], FINER * shape[1])
    seen = np.kron(valid, np.ones((FINER, FINER))) > 0
    oversampled = Oversampled(
        np.where(seen, rng.uniform(300, 301, fine), np.nan), np.where(seen, rng.uniform(0, 60, fine), 0)
    )
    sigma_m = np.where(valid.reshape(shape), rng.uniform(0.05, 0.2, shape), np.nan)
    prediction = PixelPrediction(np.where(np.isnan(sigma_m), 0.0, rng.uniform(0.0, 1.0, shape)), sigma_m)
    return {"waveforms": waveforms, "photons": photons, "oversampled": oversampled, "prediction": prediction}


def make_frames(count, **how):
    return (make_frame(k, **how) for k in range(count))


def datasets(path):
    """Return every dataset of a file with its attributes, as bytes that can be compared."""
    found = {}

    def visit(name, item):
        if isinstance(item, h5py.Dataset):
            plain = {k: np.array(v).tobytes() for k, v in item.attrs.items() if k not in ("DIMENSION_LIST",)}
            plain.pop("REFERENCE_LIST", None)  # addresses in the file
            found[name] = (item.shape, item.dtype.str, item[()].tobytes(), plain)

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


def leave_unfinished(path, frames, run_id, **how):
    """Record frames, and then let an exception end the run."""
    with contextlib.suppress(ZeroDivisionError), export.Recorder(path, SOURCE, run_id=run_id, **how) as recorder:
        for frame in frames:
            recorder.write(frame)
        raise ZeroDivisionError


def image(record):
    """Return what a recording keeps of photons; of others all."""
    if not isinstance(record, Photons):
        return record
    total = np.zeros(record.shape)
    np.add.at(total.reshape(-1), record.pixel, record.photons)
    return export.PhotonImage(total, record.background_photons_per_s)


def assert_same_record(a, b):
    assert type(a).__name__ == type(b).__name__  # the module of a test may be loaded under two names
    assert vars(a).keys() == vars(b).keys()
    for name, value in vars(a).items():
        other = getattr(b, name)
        if isinstance(value, np.ndarray):
            assert value.dtype == other.dtype
            np.testing.assert_array_equal(value, other, err_msg=name)
        else:
            assert value == other, name


def assert_same(a, b):
    """Two frames hold the same: arrays bit for bit, rotations to the rounding of a quaternion."""
    assert (a.index, a.time_s, a.truth.time_s) == (b.index, b.time_s, b.truth.time_s)
    assert a.source == b.source
    assert dict(a.observation.settings) == dict(b.observation.settings)
    assert_same_record(a.observation.reading, b.observation.reading)
    assert list(a.observation.sensors) == list(b.observation.sensors)
    for name, samples in a.observation.sensors.items():
        assert_same_record(samples, b.observation.sensors[name])
    assert_same_record(a.labels, b.labels)
    assert list(a.kept) == list(b.kept)
    for name in a.kept:
        assert_same_record(image(a.kept[name]), image(b.kept[name]))
    assert a.truth.sunlit == b.truth.sunlit
    np.testing.assert_array_equal(a.line_of_sight, b.line_of_sight)
    assert (a.truth.pointing is None) == (b.truth.pointing is None)
    if a.truth.pointing is not None:
        np.testing.assert_array_equal(a.observation.pan_tilt_rad, b.observation.pan_tilt_rad)
        for name, value in vars(a.truth.pointing).items():
            np.testing.assert_array_equal(value, getattr(b.truth.pointing, name), err_msg=name)
    np.testing.assert_array_equal(a.truth.sun_direction, b.truth.sun_direction)
    assert list(a.truth.states) == list(b.truth.states)
    for name, state in a.truth.states.items():
        np.testing.assert_array_equal(state.position_m, b.truth.states[name].position_m)
        np.testing.assert_array_equal(state.velocity_m_s, b.truth.states[name].velocity_m_s)
    assert list(a.truth.poses) == list(b.truth.poses)
    for name, link in a.truth.poses.items():
        other = b.truth.poses[name]
        assert a.truth.poses.parent(name) == b.truth.poses.parent(name)
        np.testing.assert_array_equal(link.pose.translation, other.pose.translation)
        np.testing.assert_array_equal(link.velocity_m_s, other.velocity_m_s)
        np.testing.assert_array_equal(link.angular_velocity_rad_s, other.angular_velocity_rad_s)
        # A rotation goes matrix -> quaternion -> matrix: some roundings of 1.1e-16 each.
        np.testing.assert_allclose(link.pose.rotation.as_matrix(), other.pose.rotation.as_matrix(), atol=2e-15)


@contextlib.contextmanager
def folder_of_somebody():
    """Give a new folder to somebody whom rights bind: where root runs the tests, act as user 65534, nobody, meanwhile."""
    root = os.name == "posix" and os.geteuid() == 0
    folder = Path(tempfile.mkdtemp())  # pytest's own folders are closed to other users
    try:
        if root:
            os.chown(folder, 65534, -1)
            os.seteuid(65534)
        yield folder
    finally:
        folder.chmod(0o700)
        if root:
            os.seteuid(0)
        shutil.rmtree(folder)


def read_arrays(path):
    """Return the datasets of a recording that are no scales of dimensions, by name."""
    found = {}

    def visit(name, item):
        if isinstance(item, h5py.Dataset) and name.rpartition("/")[2] not in (
            *("row", "col", "xyz", "quaternion", "return", "sample", "fine_row", "fine_col", "lens_number"),
        ):
            found[name] = item[()]

    with h5py.File(path) as file:
        file.visititems(visit)
        found |= {
            f"truth/{name}/quaternion": file[f"truth/{name}/quaternion"][()]
            for name in file["truth"]
            if name != "sun_direction"
        }
    return found
