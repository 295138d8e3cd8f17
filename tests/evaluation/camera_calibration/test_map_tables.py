import h5py
import numpy as np
import pytest
from scipy.io import savemat

from rso_lidar.errors import ScenarioError
from rso_lidar.evaluation import CurvesFile
from rso_lidar.evaluation.camera_calibration.map_tables import read_maps, read_shots
from rso_lidar.evaluation.camera_calibration.measured_tables import Tables
from rso_lidar.scenario import Scenario
from tests.evaluation.camera_calibration.map_bench_for_tests import MAPS, SHAPE, SHOTS, make_maps, write_map_bench


def read(folder, text=MAPS, **changes):
    write_map_bench(folder, text, **changes)
    lidar = Scenario.load(folder / "bench.toml").lidar
    return read_maps(CurvesFile.load(folder / "curves.toml"), lidar, Tables(folder))


def read_waveforms(folder, text=SHOTS, **changes):
    write_map_bench(folder, text, **changes)
    return read_shots(CurvesFile.load(folder / "curves.toml"), Tables(folder))


def test_maps_of_means_become_si_units(tmp_path):
    counts, error_m = read(tmp_path)
    assert np.array_equal(counts.value, make_maps()["counts"], equal_nan=True)
    assert error_m.value == pytest.approx(0.01 * make_maps()["range"] - 21.0, abs=1e-12, nan_ok=True)
    assert (error_m.range_m, error_m.photons) == (21.0, 9000.0)
    assert np.all(counts.trials == 400.0)


@pytest.mark.parametrize("suffix", [".csv", ".h5", ".mat", "-7.3.mat"])
def test_every_format_gives_the_same_map(tmp_path, suffix):
    counts, name = make_maps()["counts"], f"other{suffix}"
    if suffix == ".csv":
        rows = [f"{row},{col},{counts[row, col]}" for col in range(SHAPE[1]) for row in range(SHAPE[0])]
        (tmp_path / name).write_text("\n".join(["row,col,counts", *rows]), encoding="utf-8")
    elif suffix == ".mat":
        savemat(tmp_path / name, {"counts": counts})
    else:
        with h5py.File(tmp_path / name, "w", userblock_size=512 if "7.3" in suffix else 0) as file:
            file["counts"] = counts.T if "7.3" in suffix else counts  # MATLAB stores columns first
        if "7.3" in suffix:
            with (tmp_path / name).open("r+b") as stream:
                stream.write(b"MATLAB 7.3 MAT-file".ljust(128))
    (first, _) = read(tmp_path, MAPS.replace("maps.npz", name, 1))
    assert np.array_equal(first.value, counts, equal_nan=True)


def test_a_stack_gives_means_without_outliers_and_their_scatter(tmp_path):
    rng = np.random.Generator(np.random.Philox(2))
    stack = 300.0 + 5.0 * rng.standard_normal((200, *SHAPE))
    stack[3, 1, 1] = 4000.0  # a false trigger
    stack[::2, 4, 4] = 0.0  # no return
    stack[:, 2, 3] = 0.0  # dead
    (first, _) = read(tmp_path, MAPS.replace("trials = 400", "", 1), counts=stack)
    assert first.trials[1, 1] == 199.0
    assert first.trials[4, 4] == 100.0
    assert np.isnan(first.value[2, 3])
    assert first.value[1, 1] == pytest.approx(300.0, abs=5.0 * 5.0 / 199**0.5)
    assert first.scatter == pytest.approx(5.0, rel=5.0 / np.sqrt(2.0 * 200 * 47))


def test_a_stack_of_detections_is_counted(tmp_path):
    hits = np.random.Generator(np.random.Philox(2)).random((50, *SHAPE)) < 0.3
    text = MAPS.replace('"counts_mean"', '"detection_rate"').replace('["gain",', '["threshold",')
    (first, _) = read(tmp_path, text.replace("trials = 400", "", 1), counts=hits)
    assert np.array_equal(first.value, hits.sum(axis=0))
    assert np.all(first.trials == 50.0)


def change(name, place, value):
    array = make_maps()[name]
    array[place] = value
    return {name: array}


RATE = MAPS.replace('"counts_mean"', '"detection_rate"').replace('["gain",', '["threshold",')


@pytest.mark.parametrize(
    ("text", "changes", "words"),
    [
        (MAPS, {"counts": np.ones((8, 6))}, r"has the shape \(8, 6\), and the receiver 6 x 8 pixels"),
        (MAPS, {"counts": np.ones(48)}, r"has the shape \(48,\)"),
        (MAPS, {"counts": np.ones((1, *SHAPE))[:, :, :4]}, r"has the shape \(6, 4\)"),
        (MAPS, change("counts", (0, 0), np.inf), "holds infinite values"),
        (MAPS, change("counts", (0, 0), -3.0), "-3 is below 0"),
        (MAPS, {"counts": np.full(SHAPE, np.nan)}, "all values are nan"),
        (MAPS.replace('value = "counts"', 'value = "count"'), {}, "has no column 'count'; did you mean 'counts'"),
        (MAPS.replace("trials = 400", "", 1), {}, "trials: is missing"),
        (MAPS.replace("trials = 400", 'trials = "counts"', 1), {}, "'counts' is not a finite number for each"),
        (MAPS.replace('unit = "cm"', 'unit = "counts"'), {}, "'counts' is no unit of range_mean"),
        (MAPS.replace("photons = 9000", "", 1), {}, "counts_mean needs its light"),
        (MAPS.replace("pixel_constants", "maps"), {}, "unknown key 'maps'"),
        (MAPS.replace('["gain", "t0"]', '["gains"]'), {}, "'gain', 'offset', 't0' or 'threshold'|pixel_constants"),
        (MAPS.replace('pixel_constants = ["gain", "t0"]', ""), {}, "pixel_constants: none is named"),
        (RATE, change("counts", (0, 0), 1.0) | {}, "is nan; correct it, with 0 for a pixel that reports nothing"),
        (RATE, {"counts": np.full(SHAPE, 35.0)}, 'a rate of 35 is not between 0 and 1; .* unit = "percent"'),
        ("version = 1\nname = 'none'\n", {}, "holds no measurement"),
    ],
)
def test_what_is_no_map_is_refused_in_one_line(tmp_path, text, changes, words):
    with pytest.raises(ScenarioError, match=words) as caught:
        read(tmp_path, text, **changes)
    assert "\n" not in str(caught.value)


def test_lines_of_pixels_that_the_array_has_not_are_refused(tmp_path):
    (tmp_path / "other.csv").write_text("row,col,counts\n0,8,3\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"point 1 is of pixel \(0, 8\), and the receiver has 6 x 8"):
        read(tmp_path, MAPS.replace("maps.npz", "other.csv", 1))
    (tmp_path / "other.csv").write_text("row,col,counts\n0,7,3\n0,7,4\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match="has 1 of 48 pixels in 2 lines"):
        read(tmp_path, MAPS.replace("maps.npz", "other.csv", 1))


def test_shots_are_split_by_their_light(tmp_path):
    photons = np.repeat([0.0, 3.0], 50)
    text = SHOTS + 'photons = "photons"\nphotons_per_unit = 1000\ndensity = 1\ncounts_per_unit = 2\n'
    ((dark, light),) = read_waveforms(tmp_path, text, photons=photons)
    assert (dark.photons, light.photons) == (0.0, pytest.approx(300.0))
    assert dark.samples_counts.shape == (50, 20)
    assert dark.samples_counts.mean() == pytest.approx(120.0, abs=5.0 * 2.0 * 5.6 / 1000**0.5)
    assert dark.sample_s == pytest.approx(2.38e-9)


def test_shots_of_a_csv_file_have_a_line_each(tmp_path):
    lines = ["v0,v1,v2,v3,v4,v5,v6,v7,v8,v9,v10", *(",".join(str(k + n) for k in range(11)) for n in range(30))]
    (tmp_path / "other.csv").write_text("\n".join(lines), encoding="utf-8")
    ((shots,),) = read_waveforms(tmp_path, SHOTS.replace("shots.npz", "other.csv").replace('"samples"', '"v"'))
    assert shots.samples_counts[4].tolist() == [float(k + 4) for k in range(11)]


@pytest.mark.parametrize(
    ("text", "changes", "words"),
    [
        (SHOTS, {"samples": np.ones(20)}, "holds one shot, which tells no scatter"),
        (SHOTS, {"samples": np.ones((2, 20, 3))}, r"has the shape \(2, 20, 3\)"),
        (SHOTS, {"samples": np.ones((30, 4))}, "shots of 4 samples hold no pulse"),
        (SHOTS, {"samples": np.where(np.eye(30, 20) > 0, np.nan, 5.0)}, "shot 1, sample 1 is nan"),
        (SHOTS.replace('"samples"', '"sample"'), {}, "has no column 'sample'; did you mean 'samples'"),
        (SHOTS + 'photons = "photons"\n', {"photons": np.ones(3)}, "for each of 100 shots"),
        (SHOTS + 'photons = "photons"\n', {"photons": np.arange(101.0)[:100] + 1}, None),
        (SHOTS.replace("sample_ns = 2.38", ""), {}, "sample_ns"),
        (SHOTS.replace('constants = ["readout.baseline_counts"]', ""), {}, "constants: none is named"),
    ],
)
def test_what_are_no_shots_is_refused_in_one_line(tmp_path, text, changes, words):
    if words is None:
        assert len(read_waveforms(tmp_path, text, **changes)[0]) == 100
        return
    with pytest.raises(ScenarioError, match=words) as caught:
        read_waveforms(tmp_path, text, **changes)
    assert "\n" not in str(caught.value)
