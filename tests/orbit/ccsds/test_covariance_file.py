"""Covariances of OEM, OPM and CDM in every frame, and what is wrong with them."""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import RecordingError, RsoLidarWarning, ScenarioError
from rso_lidar.orbit import CovarianceHistory, Epochs, State, convert_states, read_covariances, write_oem, write_opm
from rso_lidar.records import BodyState

START = datetime.datetime(2024, 9, 17, 12, tzinfo=datetime.UTC)
LOW = State(epoch_utc=START, position_m=(6.9e6, 0.3e6, 0.2e6), velocity_m_s=(-400.0, 1200.0, 7450.0))
ROOT = np.random.default_rng(3).normal(size=(6, 6)) * np.array([10.0, 100.0, 8.0, 0.1, 0.01, 0.01])[:, None]
GIVEN = ROOT @ ROOT.T
TEXT = "\n".join(" ".join(f"{GIVEN[i, j] / 1e6:.15e}" for j in range(i + 1)) for i in range(6))
AT = Epochs(START, np.array([630.0]))


@pytest.fixture
def oem(tmp_path):
    def write(frame=None, rows=TEXT, epoch="2024-09-17T12:10:30", more=""):
        epochs = Epochs(START, np.arange(0.0, 3000.0, 60.0))
        path = write_oem(tmp_path / "craft.oem", "CRAFT", "2024-001A", epochs, LOW.states(epochs), overwrite=True)
        named = "" if frame is None else f"COV_REF_FRAME = {frame}\n"
        block = f"\nCOVARIANCE_START\nEPOCH = {epoch}\n{named}{rows}\n{more}COVARIANCE_STOP\n"
        path.write_text(path.read_text() + block)
        return path

    return write


@pytest.mark.filterwarnings("ignore:.*is in ITRF")
@pytest.mark.parametrize(
    ("frame", "axes"),
    [(None, "gcrs"), ("ICRF", "gcrs"), ("EME2000", "eme2000"), ("TOD", "tod"), ("TEME", "teme"), ("ITRF2014", "itrs")],
)
def test_states_drawn_in_a_frame_of_the_earth_have_the_covariance_that_is_read(oem, frame, axes):
    """Each column of a root, added to the state in the frame, is converted as a state: M P M^T is linear, and so is this."""
    found = read_covariances(oem(frame)).matrices[0]
    here = convert_states(LOW.states(AT), AT, to_axes=axes)
    seven = np.vstack([np.zeros((1, 6)), ROOT.T])
    epochs = Epochs(START, np.full(7, 630.0))
    there = convert_states(
        BodyState(here.position_m + seven[:, :3], here.velocity_m_s + seven[:, 3:]), epochs, from_axes=axes
    )
    columns = np.concatenate([there.position_m, there.velocity_m_s], axis=1)
    root = (columns[1:] - columns[0]).T
    scale = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    assert np.abs((found - root @ root.T) / scale).max() < 1e-6


@pytest.mark.filterwarnings("ignore:.*is in ITRF")
@pytest.mark.parametrize(("frame", "name"), [("TOD", "true_equator_and_equinox_of_date"), ("ITRF2014", "itrs")])
def test_a_covariance_of_states_that_skyfield_turns_to_a_frame_comes_back(oem, frame, name):
    """The columns of a root are added to a state, and skyfield turns each sum, with the Earth's rotation in its velocity."""
    from skyfield import framelib
    from skyfield.positionlib import Geocentric
    from skyfield.units import Distance, Velocity

    here = LOW.states(AT)
    time = AT.skyfield_time()[0]

    def turn(change):
        there = Geocentric(
            Distance(m=here.position_m[0] + change[:3]).au,
            Velocity(km_per_s=(here.velocity_m_s[0] + change[3:]) / 1e3).au_per_d,
            time,
            center=399,
        )
        place, speed = there.frame_xyz_and_velocity(getattr(framelib, name))
        return np.concatenate([place.m, speed.km_per_s * 1e3])

    root = np.array([turn(column) - turn(0.0 * column) for column in ROOT.T]).T
    turned = root @ root.T
    rows = "\n".join(" ".join(f"{turned[i, j] / 1e6:.15e}" for j in range(i + 1)) for i in range(6))
    found = read_covariances(oem(frame, rows)).matrices[0]
    scale = np.sqrt(np.outer(np.diag(GIVEN), np.diag(GIVEN)))
    # differences of states have 1e-9 m of 7e6 m; without the Earth's rotation velocities are off by 0.7 of their sigmas
    assert np.abs((found - GIVEN) / scale).max() < 1e-5


@pytest.mark.parametrize(
    ("frame", "axes", "rotating"),
    [
        ("RTN", "rtn", False),
        ("RSW_ROTATING", "rtn", True),
        ("TNW", "tnw", False),
        ("NTW_ROTATING", "ntw", True),
        ("VNC_INERTIAL", "vnc", False),
        ("LVLH_ROTATING", "lvlh_ccsds", True),
    ],
)
def test_a_covariance_along_the_orbit_is_given_back_in_its_axes(oem, frame, axes, rotating):
    history = read_covariances(oem(frame))
    assert (history.label, len(history.epochs)) == ("CRAFT", 1)
    np.testing.assert_allclose(history.at(AT, axes=axes, rotating=rotating)[0], GIVEN, rtol=1e-6, atol=1e-12)


def test_xml_and_opm_have_the_same_covariance(oem, tmp_path):
    expected = read_covariances(oem("RTN")).at(AT, axes="rtn")[0]
    names = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
    leaves = "".join(
        f"<C{names[i]}_{names[j]}>{GIVEN[i, j] / 1e6:.15e}</C{names[i]}_{names[j]}>"
        for i in range(6)
        for j in range(i + 1)
    )
    meta = {"OBJECT_NAME": "CRAFT", "OBJECT_ID": "2024-001A", "CENTER_NAME": "EARTH", "REF_FRAME": "GCRF"}
    meta |= {"TIME_SYSTEM": "UTC", "START_TIME": "2024-09-17T12:10:00", "STOP_TIME": "2024-09-17T12:12:00"}
    states = LOW.states(Epochs(START, np.array([600.0, 660.0, 720.0])))
    rows = "".join(
        f"<stateVector><EPOCH>2024-09-17T12:1{k}:00</EPOCH>"
        + "".join(
            f"<{name}>{value / 1e3:.12f}</{name}>"
            for name, value in zip(names, [*states.position_m[k], *states.velocity_m_s[k]], strict=True)
        )
        + "</stateVector>"
        for k in range(3)
    )
    path = tmp_path / "craft.xml"
    path.write_text(
        "<oem version='2.0'><body><segment><metadata>"
        + "".join(f"<{key}>{value}</{key}>" for key, value in meta.items())
        + f"</metadata><data>{rows}<covarianceMatrix><EPOCH>2024-09-17T12:10:30</EPOCH>"
        + f"<COV_REF_FRAME>RTN</COV_REF_FRAME>{leaves}</covarianceMatrix></data></segment></body></oem>"
    )
    np.testing.assert_allclose(read_covariances(path).at(AT, axes="rtn")[0], expected, rtol=1e-6, atol=1e-12)
    opm = write_opm(tmp_path / "craft.opm", "CRAFT", "2024-001A", LOW, covariance=GIVEN, covariance_axes="vnc")
    np.testing.assert_allclose(read_covariances(opm, "craft").matrices[0], GIVEN, rtol=1e-9, atol=1e-15)


def test_objects_of_a_conjunction_are_chosen_by_name():
    first, second = (read_covariances("tle/flyby.cdm", name) for name in ("OBJECT1", "99002"))
    assert second.label.endswith("(99002)") and first.label != second.label
    np.testing.assert_allclose(second.sigma[0], [20.0, 150.0, 15.0, 0.15, 0.02, 0.015], rtol=1e-9)
    for name, problem in ((None, "has two objects"), ("x", "unknown object 'x'")):
        with pytest.raises(ScenarioError, match=problem):
            read_covariances("tle/flyby.cdm", name)


def test_a_covariance_in_square_metres_is_asked_about(oem):
    rows = "\n".join(" ".join(f"{GIVEN[i, j]:.15e}" for j in range(i + 1)) for i in range(6))
    with pytest.warns(
        RsoLidarWarning, match="read in m instead of km, it would be .* then divide terms of a covariance by 1e6"
    ):
        read_covariances(oem("RTN", rows))


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"rows": "1.0"}, "line .*: the covariance of line .* has 1 numbers; give the 21"),
        ({"rows": TEXT.replace("e", "x", 1)}, "CX_X '.*' is not a number"),
        ({"rows": TEXT.replace(TEXT.split()[0], "-1.0", 1)}, "not positive semidefinite: a variance is below 0"),
        ({"frame": "MOON"}, "reference frame MOON is not supported"),
        ({"frame": "LVLH"}, "LVLH means two things"),
        (
            {"epoch": "2024-09-18T12:10:30"},
            r"line \d+: a covariance outside the states of CRAFT, which span .*; correct its EPOCH",
        ),
        ({"epoch": "noon"}, "epoch 'noon'"),
        ({"more": "EPOCH = 2024-09-17T12:10:20\n" + TEXT + "\n"}, "do not increase"),
    ],
)
def test_what_is_wrong_with_a_covariance_is_named_in_one_line(oem, changes, problem):
    with pytest.raises(ValueError, match=problem) as error:
        read_covariances(oem(**changes))
    assert "\n" not in str(error.value) and "craft.oem" in str(error.value)


def test_an_ephemeris_without_covariance_says_so(tmp_path):
    epochs = Epochs(START, np.arange(0.0, 300.0, 60.0))
    path = write_oem(tmp_path / "craft.oem", "CRAFT", "2024-001A", epochs, LOW.states(epochs))
    with pytest.raises(ScenarioError, match="has no covariance of CRAFT; add COVARIANCE_START"):
        read_covariances(path)


ROWS = Epochs(START, np.arange(0.0, 3000.0, 60.0))
FOUR = Epochs(START, np.array([0.0, 610.5, 1200.0, 2940.0]))
KNOWN = CovarianceHistory.from_axes("CRAFT", LOW, FOUR, np.arange(1.0, 5.0)[:, None, None] * GIVEN)


def write(path, covariances=KNOWN, **options):
    return write_oem(
        path, "CRAFT", "2024-001A", ROWS, LOW.states(ROWS), covariances=covariances, overwrite=True, **options
    )


def at_instant(time_s):
    return CovarianceHistory("CRAFT", "", LOW, Epochs(START, np.array([time_s])), GIVEN[None])


@pytest.mark.filterwarnings("ignore:.*is in ITRF")
@pytest.mark.parametrize("covariance_axes", [None, "rtn", "tnw", "ntw", "vnc", "lvlh_ccsds"])
@pytest.mark.parametrize("axes", ["gcrs", "tod", "itrs"])
def test_covariances_that_are_written_are_read_again(tmp_path, covariance_axes, axes):
    path = write(tmp_path / "a.oem", axes=axes, covariance_axes=covariance_axes, breaks_s=[1200.0])
    back = read_covariances(path)
    assert path.read_text().count("COVARIANCE_START") == 2  # one block in each segment
    assert ("COV_REF_FRAME = " in path.read_text()) == (covariance_axes is not None)
    np.testing.assert_allclose(back.epochs.time_s, FOUR.time_s, atol=1e-9)
    given, found = (history.at(FOUR, axes="rtn") for history in (KNOWN, back))
    sigma = np.sqrt(np.diagonal(given, axis1=1, axis2=2))
    off = np.abs(found - given) / (sigma[:, :, None] * sigma[:, None, :])
    # At rows the states have 1e-6 m of 7e6 m; between them Hermite's polynomial is good to 10 um here, 2e-12, and rows in
    # axes of date to 1 mm, 2e-10. Sigmas along and across the track differ by 50, velocities along it cancel to 1e-2.
    assert off[[0, 2, 3]].max() < 1e-11 and off[1].max() < (1e-9 if axes == "gcrs" else 1e-6)


def test_other_programs_read_the_covariances_that_are_written(tmp_path):
    """Package `oem` 0.4.5 reads the file's terms to 6e-15; `beyond` 0.9 turns those in GCRF to TNW by its own matrices.

    The standard deviations are those that `beyond` printed for the covariance at 12:00:00 of this file.
    """
    back = read_covariances(write(tmp_path / "a.oem"))
    sigma = np.sqrt(np.diag(back.at(START, axes="tnw")[0]))
    expected = [401.44437155521973, 31.476807690805728, 11.539582806706134]
    expected += [0.024029214021585036, 0.19733466915546485, 0.01563332417803308]
    np.testing.assert_allclose(sigma, expected, rtol=1e-9)
    lines = write(tmp_path / "b.oem", covariance_axes="rtn").read_text().splitlines()
    first = lines.index("COVARIANCE_START")
    assert lines[first + 1 : first + 3] == ["EPOCH = 2024-09-17T12:00:00.000", "COV_REF_FRAME = RTN"]
    stated = [float(word) * 1e6 for line in lines[first + 3 : first + 9] for word in line.split()]
    np.testing.assert_allclose(stated, GIVEN[np.tril_indices(6)], rtol=1e-9, atol=1e-15 * np.diag(GIVEN).max())


def test_covariances_of_other_orbits_and_instants_are_not_written(tmp_path):
    late = CovarianceHistory("CRAFT", "", LOW, Epochs(START, np.array([60.0, 2950.0])), np.array([GIVEN] * 2))
    other = State(epoch_utc=START, position_m=(0.0, 7e6, 0.0), velocity_m_s=(-7546.0, 0.0, 0.0))
    far = CovarianceHistory("OTHER", "", other, Epochs(START, np.zeros(1)), GIVEN[None])
    bare = GIVEN.copy()
    bare[3:] = bare[:, 3:] = 0.0
    place = CovarianceHistory("CRAFT", "", LOW, Epochs(START, np.zeros(1)), bare[None], has_velocity=False)
    for covariances, problem in (
        (late, "1 of 2 are at epochs outside the segments of the states, first 2024-09-17T12:49:10"),
        (far, "are about an orbit that is .* km from the states"),
        (place, "have no terms of velocity"),
    ):
        with pytest.raises(RecordingError, match=problem) as error:
            write(tmp_path / "never.oem", covariances)
        assert "\n" not in str(error.value)
    with pytest.raises(RecordingError, match="outside the segments"):  # 1270 s is between the rows beside a break
        write(tmp_path / "never.oem", breaks_s=[1140.0, 1290.0], covariances=at_instant(1270.0))
    with pytest.raises(ScenarioError, match="'lvlh' means two things"):
        write(tmp_path / "never.oem", covariance_axes="lvlh")
    assert not list(tmp_path.iterdir())
