"""Words of a report: what is rounded, what is clipped, and where in a word the bits stand."""

import math

import numpy as np
import pytest

from rso_lidar.detector import Empirical, GeigerArray, Gsfl, ReportWords
from rso_lidar.errors import RecordError, ScenarioError
from rso_lidar.records import Reading

FOOT_M = 0.3048


def reading(range_m, counts, **more):
    range_m = np.atleast_2d(np.asarray(range_m, np.float32))
    counts = np.broadcast_to(np.asarray(counts, np.uint16), range_m.shape).copy()
    return Reading(range_m, counts, np.zeros(range_m.shape, np.uint8), **more)


def test_the_defaults_are_20_bits_of_64th_feet_above_12_bits_of_intensity():
    words = ReportWords(no_return_word=192_000).encode(
        reading([10.0 * FOOT_M, 5_000.0, math.nan, 4_993.7], [7, 9, 0, 5000])
    )
    assert words.dtype == np.dtype("<u4") and words.shape == (1, 1, 4)
    assert words[0, 0].tolist() == [
        640 << 12 | 7,
        192_000 << 12,
        192_000 << 12,
        round(4_993.7 * 64 / FOOT_M) << 12 | 4095,
    ]
    assert ReportWords().range_to_m == pytest.approx((2**20 - 1) / 64 * FOOT_M)


def test_ranges_are_rounded_from_the_offset_on():
    report = ReportWords(
        range_quantum_m=0.5, range_offset_m=100.0, range_bits=4, intensity_bits=4, intensity_quantum_counts=10.0
    )
    words = report.encode(reading([99.7, 99.8, 100.3, 107.7, 107.8], [4, 6, 15, 149, 999]))
    assert words.dtype == np.dtype("u1")
    # 15 steps reach to 107.5 m; a range beyond it, or below word 0, is no return.
    assert (words[0, 0] >> 4).tolist() == [0, 0, 1, 15, 0]
    assert (words[0, 0] & 15).tolist() == [0, 1, 2, 15, 0]


def test_rounding_scatters_by_a_quantum_over_the_root_of_twelve():
    report = ReportWords(range_quantum_m=0.3)
    range_m = np.random.default_rng(1).uniform(100.0, 200.0, (64, 64)).astype(np.float32)
    back_m = (report.encode(reading(range_m, 50))[0] >> 12) * 0.3
    assert np.abs(back_m - range_m).max() <= 0.15 + 1e-5
    # The rms of n uniform errors is known to 1 over root 5 n, relative; 4 sigma of 4096 errors.
    assert np.sqrt(np.mean((back_m - range_m) ** 2)) == pytest.approx(
        0.3 / math.sqrt(12.0), rel=4 / math.sqrt(5 * 4096)
    )


def test_two_returns_are_two_images_of_the_nearest():
    listed_m = np.array([[[10.0, 20.0, 30.0], [15.0, math.nan, math.nan]]], np.float32)
    counts = np.array([[[5, 6, 7], [8, 0, 0]]], np.uint16)
    given = reading([[30.0, 15.0]], [7, 8], return_range_m=listed_m, return_intensity_counts=counts)
    words = ReportWords(range_quantum_m=1.0, range_bits=8, intensity_bits=8).encode(given)
    assert words.dtype == np.dtype("<u2")
    assert words.tolist() == [[[10 << 8 | 5, 15 << 8 | 8]], [[20 << 8 | 6, 0]]]


def test_flags_stand_above_the_range():
    flags = {name: np.array([[k, 1, 0]], np.uint8) for k, name in enumerate(("crosstalk", "superimposed"))}
    given = reading([[10.0, math.nan, 12.0]], [5, 0, 6], **flags)
    given.saturated.setflags(write=True)
    given.saturated[0, 2] = 1
    report = ReportWords(range_quantum_m=1.0, range_bits=8, intensity_bits=5, flags=True)
    assert report.word_bits == 16
    assert report.encode(given)[0, 0].tolist() == [4 << 13 | 10 << 5 | 5, 0, 2 << 13 | 12 << 5 | 6]
    assert ReportWords(flags=True).word_bits == 64
    with pytest.raises(RecordError, match="has no flag 'crosstalk'"):
        report.encode(reading([10.0], 5))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"no_return_word": 2**20}, "no_return_word .1048576. needs more than range_bits .20."),
        ({"range_quantum_m": 0.0}, "range_quantum_m"),
        ({"range_bits": 33}, "range_bits"),
        ({"intensity_bits": 0}, "intensity_bits"),
        ({"intensity_quantum_counts": -1.0}, "intensity_quantum_counts"),
        ({"range_offset_m": float("inf")}, "range_offset_m"),
        ({"returns": 2}, "unknown key 'returns'"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(given, said):
    with pytest.raises(ScenarioError, match=said):
        Gsfl(report=given)


def test_detectors_without_pulses_have_words_but_no_flags():
    for kind in (Empirical, GeigerArray):
        assert kind(report={}).report == ReportWords()
        with pytest.raises(ScenarioError, match=r"report\.flags"):
            kind(report={"flags": True})
