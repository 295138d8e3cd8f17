import h5py
import numpy as np
import pytest
from scipy.io import savemat

from rso_lidar import units
from rso_lidar.detector import Empirical
from rso_lidar.errors import ScenarioError
from rso_lidar.evaluation import CurvesFile
from rso_lidar.evaluation.camera_calibration.measured_tables import Tables, read_curves, read_table
from rso_lidar.scenario import Lidar
from tests.evaluation.camera_calibration.bench_for_tests import CURVES, make_table, write_bench, write_csv

LIDAR = Lidar(receiver={"fov_deg": 2.5, "f_number": 2.8}, detector=Empirical())


def read(folder, text=CURVES, columns=None):
    write_bench(folder, text, columns)
    return read_curves(CurvesFile.load(folder / "curves.toml"), LIDAR, Tables(folder))


def test_filters_and_hits_become_photons_and_rates(tmp_path):
    (curve,) = read(tmp_path)
    table = make_table()
    assert curve.photons == pytest.approx(1e4 / 10.0 ** table["OD"], rel=1e-12)
    assert curve.value == pytest.approx(table["hits"] / 4000.0, rel=1e-12)
    assert curve.range_m == pytest.approx(np.full(12, 21.0))


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".mat", "-7.3.mat"])
def test_every_format_gives_the_same_columns(tmp_path, suffix):
    columns, path = make_table(), tmp_path / f"rate{suffix}"
    if suffix == ".npz":
        np.savez(path, **columns)
    elif suffix == ".mat":
        savemat(path, columns)
    else:
        with h5py.File(path, "w", userblock_size=512 if "7.3" in suffix else 0) as file:
            for name, values in columns.items():
                file[name] = values[None] if "7.3" in suffix else values
        if "7.3" in suffix:
            with path.open("r+b") as stream:
                stream.write(b"MATLAB 7.3 MAT-file".ljust(128))
    found = read_table(path)
    assert {name: values.tolist() for name, values in found.items()} == {k: v.tolist() for k, v in columns.items()}


def test_columns_of_other_units_and_separators(tmp_path):
    (tmp_path / "walk.csv").write_text("N; t_ns; n; R\n500; 133.5; 40; 20\n900; 133.4; 40; 20\n", encoding="utf-8")
    text = """
version = 1
name = "walk"
constants = ["range_plateau_m"]
[[curve]]
quantity = "range_mean"
file = "walk.csv"
photons = "N"
photons_per_unit = 2.0
value = "t_ns"
unit = "ns"
trials = "n"
range_m = "R"
range_offset_m = 0.01
"""
    (curve,) = read(tmp_path, text)
    expected = np.array([133.5, 133.4]) * units.NS * units.RANGE_PER_DELAY_M_S - 20.0 - 0.01
    assert curve.value == pytest.approx(expected, abs=1e-9)
    assert curve.photons.tolist() == [1000.0, 1800.0]


def change(column, k, value):
    columns = make_table()
    columns[column][k] = value
    return columns


@pytest.mark.parametrize(
    ("old", "new", "columns", "words"),
    [
        ("", "", change("hits", 3, np.nan), "column 'hits': point 4 is nan"),
        ("", "", change("flashes", 0, 0.0), "trials: 0 is not above 0"),
        ("", "", change("hits", 0, 9000.0), "a rate of 2.25 is not between 0 and 1"),
        ('density = "OD"', 'density = "ND"', None, "has no column 'ND'; did you mean 'OD'"),
        ('file = "rate.csv"', 'file = "rates.csv"', None, "rates.csv: no such file"),
        ('file = "rate.csv"', 'file = "rate.txt"', None, "unknown suffix '.txt'"),
        ('unit = "hits"', 'unit = "m"', None, "'m' is no unit of detection_rate"),
        ("photons = 10000", "", None, "detection_rate needs its light"),
        ('quantity = "detection_rate"', 'quantity = "dark_counts"', None, "'hits' is no unit of dark_counts"),
        ('value = "hits"', 'value = "hits"\nthreshold = 5', None, "threshold is for dark_counts"),
        ("photons = 10000", "photon = 10000", None, "unknown key 'photon'"),
    ],
)
def test_what_is_no_measurement_is_refused_in_one_line(tmp_path, old, new, columns, words):
    with pytest.raises(ScenarioError, match=words) as caught:
        read(tmp_path, CURVES.replace(old, new, 1) if old else CURVES, columns)
    assert "\n" not in str(caught.value)


def test_damaged_tables_are_refused(tmp_path):
    for name, content in (
        ("short.csv", "a,b\n1,2\n3\n"),
        ("empty.csv", "a,b\n"),
        ("bad.npz", "no"),
        ("bad.h5", "no"),
        ("bad.mat", "no"),
    ):
        (tmp_path / name).write_text(content, encoding="utf-8")
        with pytest.raises(ScenarioError, match=name):
            read_table(tmp_path / name)


def test_a_cell_without_a_number_is_named(tmp_path):
    write_bench(tmp_path)
    text = (tmp_path / "rate.csv").read_text(encoding="utf-8").replace("4000.0", "many", 1)
    (tmp_path / "rate.csv").write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError, match="column 'hits': point 1: 'many' is not a number"):
        read_curves(CurvesFile.load(tmp_path / "curves.toml"), LIDAR, Tables(tmp_path))


def test_a_table_of_many_columns_is_read_once_by_name(tmp_path):
    columns = make_table()
    write_csv(tmp_path / "one.csv", columns)
    assert list(read_table(tmp_path / "one.csv")) == list(columns)
