"""Recordings in the form of PixSet: what is read of them, and what is refused in one line."""

import pickle
import zipfile

import numpy as np
import pytest

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.evaluation import read_pixset
from tests.evaluation.raw_waveforms.recordings_for_tests import (
    CHANNELS,
    FIRST_M,
    SAMPLE_NS,
    SAMPLES,
    Bomb,
    dump_as_numpy_1,
    make_flash,
    write_pickles,
    write_recording,
)


@pytest.mark.parametrize("protocol", [2, 4, 5])
def test_both_gains_of_each_flash_are_read(tmp_path, protocol):
    sets = list(read_pixset(write_recording(tmp_path / "a", 2, protocol=protocol)))
    assert [raw.gain for raw in sets] == ["low", "high", "low", "high"]
    first, flash = sets[1], make_flash(0)["high"]
    assert first.samples_counts.shape == (CHANNELS, SAMPLES - 3)  # the copies are left out, the sample itself stays
    assert np.array_equal(first.samples_counts, flash["data"][:, 3:])
    assert first.sample_s == pytest.approx(SAMPLE_NS * 1e-9, rel=1e-9)
    expected_s = flash["time_base_delays"] / units.RANGE_PER_DELAY_M_S + 3 * first.sample_s
    assert first.delay_s == pytest.approx(expected_s, abs=1e-15)
    # 121 samples before emission, less 3 copies, 16 that a pulse may reach, and 0.1 m or one between channels.
    assert 121 - 3 - 16 - 2 <= first.dark_samples <= 121 - 3 - 16


def test_words_of_numpy_1_are_read(tmp_path):
    blob = dump_as_numpy_1(make_flash(0))
    assert b"numpy.core" in blob
    path = write_pickles(tmp_path / "pixell_bfc_ftrr.zip", [blob])
    assert [raw.gain for raw in read_pixset(path)] == ["low", "high"]


def test_flashes_are_taken_over_the_whole_recording(tmp_path):
    sets = list(read_pixset(write_recording(tmp_path / "a", 5), flashes=2))
    assert len(sets) == 4
    assert np.array_equal(sets[3].samples_counts, make_flash(4)["high"]["data"][:, 3:])


def without(*keys):
    def change(flash):
        for gain in ("low", "high"):
            for key in keys:
                del flash[gain][key]
        return flash

    return change


def test_delays_come_from_the_settings_where_the_waveforms_have_none(tmp_path):
    folder = write_recording(tmp_path / "a", 1, without("time_base_delays", "distance_scaling"))
    unknown = list(read_pixset(folder))
    assert np.isnan(unknown[0].delay_s).all() and unknown[0].dark_samples == 64 - 3
    assert unknown[0].sample_s == pytest.approx(1.25e-9, rel=1e-9)
    delays_m = np.repeat([FIRST_M, FIRST_M + 5.0], CHANNELS)
    write_pickles(folder / "pixell_bfc_cfg.zip", [{"calibration": {"ID_TIMEBASE_DELAY": delays_m}}])
    low, high = read_pixset(folder)
    assert low.delay_s[0] == pytest.approx(FIRST_M / units.RANGE_PER_DELAY_M_S + 3 * low.sample_s, rel=1e-6)
    assert (
        low.dark_samples == high.dark_samples + 27 or low.dark_samples == high.dark_samples + 26
    )  # 5 m are 26.7 samples
    write_pickles(folder / "pixell_bfc_cfg.zip", [{"calibration": {}}])
    assert np.isnan(next(read_pixset(folder)).delay_s).all()


def test_a_pickle_that_would_run_code_is_refused(tmp_path, capsys):
    path = write_pickles(tmp_path / "pixell_bfc_ftrr.zip", [{**make_flash(0), "more": Bomb()}])
    with pytest.raises(
        ScenarioError, match=r"00000000\.pkl: cannot be read: names __builtin__.print, which is no data"
    ):
        list(read_pixset(path))
    assert capsys.readouterr().out == ""


def test_a_pickle_cannot_change_what_reads_it(tmp_path):
    """BUILD would set attributes of a function that later pickles call."""
    state = b"(N}X\x0c\x00\x00\x00__defaults__)st"  # (None, {"__defaults__": ()})
    for name in (b"cnumpy.core.numeric\n_frombuffer\n", b"c_codecs\nencode\n", b"cnumpy\nndarray\n"):
        path = write_pickles(tmp_path / "pixell_bfc_ftrr.zip", [b"\x80\x02" + name + state + b"b."])
        with pytest.raises(ScenarioError, match="is a damaged pickle"):
            list(read_pixset(path))
    assert np.frombuffer(b"", "u1").size == 0 and np.empty(1).__reduce_ex__(5)[0].__defaults__ != ()


class OverBuffer:
    """An array of objects whose addresses the pickle chooses."""

    def __reduce__(self):
        return np.ndarray, ((1,), "O", b"A" * 8)


@pytest.mark.parametrize("more", [OverBuffer(), np.array([None]), np.zeros(1, [("a", "O")])])
def test_a_pickle_cannot_make_arrays_of_addresses(tmp_path, more):
    path = write_pickles(tmp_path / "pixell_bfc_ftrr.zip", [{**make_flash(0), "more": more}])
    with pytest.raises(
        ScenarioError, match=r"cannot be read: (calls numpy\.ndarray|has an array of .*neither numbers)"
    ):
        list(read_pixset(path))


def set_low(**changes):
    def change(flash):
        flash["low"].update(changes)
        return flash

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda flash: [1, 2], r"has no array 'low\.data'"),
        (lambda flash: {"low": flash["low"]}, r"has no array 'high\.data'"),
        (set_low(data=np.zeros((4, 9))), r"'data' is float64 \(4, 9\), not numbers"),
        (set_low(data=np.full((4, 200), np.nan)), "not numbers"),
        (set_low(data=np.full((4, 200), "a")), "not numbers"),
        (set_low(time_base_delays=np.zeros(7)), "delays or scale are no numbers of its channels"),
        (set_low(distance_scaling="far"), "delays or scale are no numbers"),
        (set_low(distance_scaling=187.0), "'distance_scaling' is 187.0, no range between samples"),
        (lambda flash: pickle.dumps(flash)[:500], "cannot be read|is a damaged pickle"),
        (lambda flash: b"\x80\x02cnumpy\ndtype\n(X\x01\x00\x00\x00?tR.", "has no array|damaged"),
    ],
)
def test_what_is_no_recording_is_refused_in_one_line(tmp_path, change, says):
    folder = write_recording(tmp_path / "a", 1, change)
    with pytest.raises(ScenarioError, match=says) as error:
        list(read_pixset(folder))
    assert "\n" not in str(error.value) and "pixell_bfc_ftrr.zip: 00000000.pkl" in str(error.value)


def test_files_that_are_none_are_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r"needs one file \*_ftrr\.zip, and has none"):
        list(read_pixset(tmp_path))
    (tmp_path / "a_ftrr.zip").write_bytes(b"no archive")
    with pytest.raises(ScenarioError, match=r"a_ftrr\.zip: is no ZIP file"):
        list(read_pixset(tmp_path))
    (tmp_path / "b_ftrr.zip").write_bytes(b"")
    with pytest.raises(ScenarioError, match=r"has a_ftrr\.zip, b_ftrr\.zip; name the file"):
        list(read_pixset(tmp_path))
    with pytest.raises(ScenarioError, match=r"gone\.zip"):
        list(read_pixset(tmp_path / "gone.zip"))
    with zipfile.ZipFile(tmp_path / "c.zip", "w") as archive:
        archive.writestr("readme.txt", "x")
    with pytest.raises(ScenarioError, match="holds no numbered pickles"):
        list(read_pixset(tmp_path / "c.zip"))
