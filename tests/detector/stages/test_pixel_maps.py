import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.detector import Defects, Gsfl, Maps, PixelMaps, read_pixel_maps
from rso_lidar.detector.chain.camera import build_camera, draw_camera_pixels
from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.scenario import Lidar

SHAPE = (6, 8)


def make_maps(seed=1):
    rng = np.random.Generator(np.random.Philox(seed))
    maps = {
        "gain_factor": 1.0 + 0.1 * rng.standard_normal(SHAPE),
        "offset_counts": 3.0 * rng.standard_normal(SHAPE),
        "t0_ns": rng.standard_normal(SHAPE),
        "threshold_factor": 1.0 + 0.05 * rng.standard_normal(SHAPE),
        "dark_current_na": np.full(SHAPE, 0.5),
    }
    errors = {name: np.full(SHAPE, 0.01) for name in maps}
    dead, hot = np.zeros(SHAPE, bool), np.zeros(SHAPE, bool)
    dead[2, 3], hot[4, 5] = True, True
    return PixelMaps(SHAPE, maps, errors, dead, hot, '{"name": "mine"}')


def test_a_file_gives_the_maps_again_and_the_same_maps_the_same_bytes(tmp_path):
    maps = make_maps()
    maps.save(tmp_path / "maps.npz")
    again = read_pixel_maps(str(tmp_path / "maps.npz"))
    assert again.shape == SHAPE
    assert again.provenance == maps.provenance
    for name, values in maps.maps.items():
        assert np.array_equal(again.maps[name], values)
        assert np.array_equal(again.errors[name], maps.errors[name])
    assert np.array_equal(again.dead, maps.dead)
    assert np.array_equal(again.hot, maps.hot)
    assert (tmp_path / "maps.npz").read_bytes() == make_maps().to_bytes()
    with pytest.raises(RecordingError, match="exists"):
        maps.save(tmp_path / "maps.npz")


def test_a_camera_has_the_pixels_of_its_file_in_place_of_drawn_ones(tmp_path):
    maps = make_maps()
    maps.save(tmp_path / "maps.npz")
    camera = Gsfl(maps=Maps(file=str(tmp_path / "maps.npz")), defects=Defects(dead_fraction=0.5))
    pixels = draw_camera_pixels(camera, SHAPE[0] * SHAPE[1])
    assert np.array_equal(pixels.gain, maps.maps["gain_factor"].ravel())
    assert np.array_equal(pixels.threshold, maps.maps["threshold_factor"].ravel())
    assert np.array_equal(pixels.offset_counts, maps.maps["offset_counts"].ravel())
    assert pixels.t0_s == pytest.approx(maps.maps["t0_ns"].ravel() * units.NS, rel=1e-12)
    assert np.array_equal(pixels.dead, maps.dead.ravel())  # those of `defects` do not count beside a file
    assert np.array_equal(pixels.hot, maps.hot.ravel())


def test_pixels_are_nominal_in_what_a_file_does_not_hold_but_for_thresholds(tmp_path):
    maps = make_maps()
    part = PixelMaps(SHAPE, {"t0_ns": maps.maps["t0_ns"]}, {"t0_ns": maps.errors["t0_ns"]}, maps.dead, maps.hot)
    part.save(tmp_path / "maps.npz")
    pixels = draw_camera_pixels(Gsfl(maps=Maps(file=str(tmp_path / "maps.npz"))), 48)
    assert np.all(pixels.gain == 1.0)
    assert np.all(pixels.offset_counts == 0.0)
    assert np.array_equal(pixels.threshold, draw_camera_pixels(Gsfl(), 48).threshold)
    assert pixels.threshold.std() > 0.0


def test_a_bench_of_another_size_takes_the_pixels_evenly(tmp_path):
    make_maps().save(tmp_path / "maps.npz")
    camera = Gsfl(maps=Maps(file=str(tmp_path / "maps.npz")))
    gain = draw_camera_pixels(camera, 4800).gain
    for part in (gain[:2400], gain[2400:]):
        _, counts = np.unique(part, return_counts=True)
        assert len(counts) == 48
        assert counts.min() >= 45  # of 50: an additive sequence leaves few gaps
        assert counts.max() <= 55


def test_a_file_that_changes_is_read_again(tmp_path):
    lidar = Lidar(receiver={"fov_deg": 2.5, "f_number": 2.8}, detector=Gsfl(maps=Maps(file=str(tmp_path / "maps.npz"))))
    make_maps().save(tmp_path / "maps.npz")
    first = build_camera(lidar.detector, lidar.pulse, 48)
    assert build_camera(lidar.detector, lidar.pulse, 48) is first
    make_maps(2).save(tmp_path / "maps.npz", overwrite=True)
    assert np.array_equal(
        build_camera(lidar.detector, lidar.pulse, 48).front.pixels.gain, make_maps(2).maps["gain_factor"].ravel()
    )


def test_the_spread_of_a_map_is_that_of_the_pixels_without_their_errors():
    maps = make_maps()
    live = ~maps.dead
    assert maps.spread("gain_factor") == pytest.approx(
        np.sqrt(maps.maps["gain_factor"][live].var() - 0.01**2), rel=1e-12
    )
    assert maps.spread("dark_current_na") == 0.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gain_factor": np.ones((3, 3))}, r"gain_factor: has the shape \(3, 3\), not \(row, col\) \(6, 8\)"),
        ({"gain_factor": np.full(SHAPE, np.nan)}, r"gain_factor: pixel \(0, 0\) has nan"),
        ({"gain_factor": np.zeros(SHAPE)}, "not between 0.05 and 20"),
        ({"gains": np.ones(SHAPE)}, "holds 'gains', which is no map"),
        ({"dead": np.zeros(SHAPE)}, "dead: holds float64; give true or false"),
        ({"dead": None}, "has no map 'dead'"),
    ],
)
def test_what_are_no_maps_is_refused(tmp_path, change, words):
    arrays = dict(make_maps().maps) | {"dead": np.zeros(SHAPE, bool)} | change
    np.savez(tmp_path / "maps.npz", **{name: values for name, values in arrays.items() if values is not None})
    with pytest.raises(ScenarioError, match=words) as caught:
        read_pixel_maps(str(tmp_path / "maps.npz"))
    assert "\n" not in str(caught.value)
