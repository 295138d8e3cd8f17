"""`rso-lidar camera`: the data sheet on the terminal and in files, and what it refuses before it writes."""

import pytest


def test_a_camera_prints_its_data_sheet_and_writes_files(rso_lidar, tmp_path):
    page, curve = tmp_path / "sheet.html", tmp_path / "sheet.csv"
    words = ("--trials", "50", "-o", str(page), "-o", str(curve))
    status, shown, errors = rso_lidar("camera", "geiger_1064", *words)
    assert (status, errors) == (0, [])
    assert "NEP of the dark counts" in shown and "93.3 aW/√Hz" in shown and str(page) in shown
    assert page.is_file() and curve.is_file()
    assert max(len(line) for line in shown.splitlines() if str(tmp_path) not in line) <= 80


def test_a_file_and_settings_are_a_camera_too(rso_lidar):
    words = ("camera", "datasheet", "examples/geiger_bench.toml", "--trials", "50")
    assert "photon detection efficiency" in rso_lidar(*words)[1]
    status, shown, _ = rso_lidar("camera", "geiger_1064", "--trials", "50", "--set", "lidar.laser.pulse_fwhm_ns=2")
    assert status == 0 and shown.startswith("geiger_1064 with lidar.laser.pulse_fwhm_ns=2")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("gsfl_1046",), "gsfl_1046: no camera of that name"),
        (("gsfl_1064", "-o", "{folder}/sheet.txt"), "unknown suffix '.txt'"),
        (("gsfl_1064", "--trials", "3"), "greater than or equal to 50"),
        (("gsfl_1064", "--dark"), "--dark: is for pictures"),
        (
            ("gsfl_1064", "--set", "lidar.detector.apd.gain=0.5", "-o", "{folder}/a.html"),
            "lidar: detector.apd.gain: should be",
        ),
        (("{folder}/none.toml",), "none.toml"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(rso_lidar, tmp_path, words, says):
    status, shown, errors = rso_lidar("camera", *(word.format(folder=tmp_path) for word in words))
    assert (status, shown) == (2, "") and len(errors) == 1 and says in errors[0]
    assert list(tmp_path.iterdir()) == []
