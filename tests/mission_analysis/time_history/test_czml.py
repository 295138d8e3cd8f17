"""CZML: its structure by the format's own words, and what a globe makes of its samples."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rso_lidar.errors import RecordingError
from rso_lidar.mission_analysis.time_history.czml import (
    CzmlBeam,
    CzmlBody,
    build_packets,
    choose_globe_samples,
    write_czml,
)

START, END = "2024-09-17T12:00:00Z", "2024-09-17T13:30:00Z"
RADIUS_M, RATE = 6928.137e3, 1.0949e-3  # a circular orbit at 550 km: 2 pi / 5739 s

# https://github.com/AnalyticalGraphicsInc/czml-writer/wiki: the properties that a packet and a clock may have.
PACKET = {"id", "name", "availability", "position", "orientation", "point", "label", "path", "polyline"}


def orbit(time_s):
    phase = RATE * time_s
    return RADIUS_M * np.stack([np.cos(phase), 0.6 * np.sin(phase), 0.8 * np.sin(phase)], axis=-1)


def document(time_s, most=2000, quaternion=None, names=("stage", "follower")):
    ahead = orbit(time_s)
    bodies = [CzmlBody(names[0], ahead, quaternion), CzmlBody(names[1], orbit(time_s - 1.0))]
    beams = [CzmlBeam("boresight", names[1], ahead)]
    return build_packets("a pass", time_s, bodies, START, END, lines=[(names[1], names[0])], beams=beams, most=most)


def test_the_document_has_the_structure_of_the_format():
    made = document(np.arange(0.0, 5400.0, 10.0))
    assert made[0] == {
        "id": "document",
        "name": "a pass",
        "version": "1.0",
        "clock": {
            "interval": f"{START}/{END}",
            "currentTime": START,
            "multiplier": 90,
            "range": "LOOP_STOP",
            "step": "SYSTEM_CLOCK_MULTIPLIER",
        },
    }
    assert len({packet["id"] for packet in made}) == len(made) == 6
    for packet in made[1:]:
        assert set(packet) <= PACKET
        assert packet["availability"] == f"{START}/{END}"
    stage = made[1]["position"]
    assert (stage["referenceFrame"], stage["epoch"]) == ("INERTIAL", START)
    assert (stage["interpolationAlgorithm"], stage["interpolationDegree"]) == ("LAGRANGE", 5)
    ids = {packet["id"] for packet in made}
    lines = [packet["polyline"]["positions"]["references"] for packet in made if "polyline" in packet]
    assert lines == [["follower#position", "stage#position"], ["follower#position", "boresight tip#position"]]
    assert {reference.split("#")[0] for line in lines for reference in line} <= ids


def test_samples_between_which_a_globe_interpolates():
    # Lagrange of degree 5 through six samples 54 s apart, as Cesium takes them: the remainder |f^(6)| h^6 * 225/46080
    # (product of the six distances at the middle, over 6!) is 1.4e-3 m, and rounding 1e-6 m.
    time_s = np.arange(0.0, 5400.0, 1.0)
    rows = np.reshape(document(time_s, most=101)[1]["position"]["cartesian"], (-1, 4))
    assert len(rows) == 101
    assert (rows[0, 0], rows[-1, 0]) == (0.0, 5399.0)
    np.testing.assert_allclose(rows[:, 1:], orbit(rows[:, 0]), atol=1e-6)
    worst = 0.0
    for k in range(0, 95, 7):
        nodes, at = rows[k : k + 6], np.mean(rows[k + 2 : k + 4, 0])
        weights = [np.prod([(at - b) / (a - b) for b in nodes[:, 0] if b != a]) for a in nodes[:, 0]]
        worst = max(worst, np.linalg.norm(np.sum(np.array(weights)[:, None] * nodes[:, 1:], axis=0) - orbit(at)))
    bound = RADIUS_M * (RATE * 54.5) ** 6 * 225 / 64 / 720
    assert worst < bound + 1e-5
    assert bound < 0.01


def test_orientation_goes_over_half_a_turn_without_a_jump():
    time_s = np.arange(0.0, 720.0, 5.0)
    turning = Rotation.from_rotvec(np.outer(time_s * np.pi / 360.0, [0.0, 0.6, 0.8]))
    made = document(time_s, quaternion=turning.as_quat(canonical=True))
    rows = np.reshape(made[1]["orientation"]["unitQuaternion"], (-1, 5))
    assert np.abs(np.diff(rows[:, 1:], axis=0)).max() < 0.05  # a step of 2.5 degrees changes no component by more
    again = Rotation.from_quat(rows[:, 1:])
    assert (again * turning.inv()).magnitude().max() < 1e-10
    assert "orientation" not in made[2]


def test_one_instant_is_a_constant():
    made = build_packets("still", np.zeros(1), [CzmlBody("a", orbit(np.zeros(1)))], START, START)
    assert made[1]["position"]["cartesian"] == [RADIUS_M, 0.0, 0.0]


def test_names_that_references_would_end_at_are_escaped():
    made = document(np.arange(3.0), names=("cz.4#b", "follower"))
    assert made[3]["polyline"]["positions"]["references"][1] == "cz\\.4\\#b#position"


def test_thinning_keeps_both_ends():
    assert choose_globe_samples(5).tolist() == [0, 1, 2, 3, 4]
    chosen = choose_globe_samples(100_000)
    assert (len(chosen), chosen[0], chosen[-1]) == (2000, 0, 99_999)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"bodies": []}, "no body"),
        ({"time_s": np.array([0.0, 2.0, 1.0])}, "do not increase"),
        ({"bodies": [CzmlBody("a", np.full((3, 3), np.nan))]}, "a: needs a finite position"),
        ({"bodies": [CzmlBody("a", np.ones((3, 3))), CzmlBody("a", np.ones((3, 3)))]}, "same name"),
        ({"bodies": [CzmlBody("a", np.ones((3, 3)), np.ones((3, 3)))]}, "needs a quaternion"),
        ({"lines": [("a", "b")]}, "ends at 'b'"),
        ({"most": 1}, "cannot show motion"),
    ],
)
def test_what_no_globe_could_read_is_refused(change, words):
    given = {"time_s": np.arange(3.0), "bodies": [CzmlBody("a", np.ones((3, 3)))], "start_utc": START, "end_utc": END}
    with pytest.raises(RecordingError, match=words):
        build_packets("bad", **{**given, **change})


def test_the_file_is_the_document(tmp_path):
    made = document(np.arange(0.0, 60.0))
    path = write_czml(tmp_path / "pass.czml", made)
    assert json.loads(path.read_text(encoding="utf-8")) == made
    assert [file.name for file in tmp_path.iterdir()] == ["pass.czml"]
    with pytest.raises(RecordingError, match="there is no folder"):
        write_czml(tmp_path / "missing" / "pass.czml", made)
