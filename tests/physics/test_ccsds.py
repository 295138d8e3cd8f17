"""CCSDS messages that others wrote, and what other packages make of ours.

The samples are from the annexes of CCSDS 502.0-B (OEM) and 504.0-B (AEM); NASA's public ephemeris of the ISS; and
eight rows as the `oem` package 0.4.5 writes them again after it has read ours. Of the station one row is NASA's, and the one
before it follows from two-body motion, so that the interpolation is one of an orbit.
"""

import datetime

import numpy as np
import pytest

from rso_lidar.errors import RsoLidarWarning, ScenarioError
from rso_lidar.motion import AttitudeTable, Body, truth
from rso_lidar.orbit import Ephemeris, Epochs, Kepler
from rso_lidar.orbit.ccsds.reader import read_message
from rso_lidar.orbit.earth.axes import gcrs_from_eme2000

# 502.0-B, annex: the OEM example of two segments and a covariance, about Mars
MARS = """CCSDS_OEM_VERS = 3.0
CREATION_DATE = 1996-11-04T17:22:31
ORIGINATOR = NASA/JPL

META_START
OBJECT_NAME         = MARS GLOBAL SURVEYOR
OBJECT_ID           = 1996-062A
CENTER_NAME         = MARS BARYCENTER
REF_FRAME           = J2000
TIME_SYSTEM         = UTC
START_TIME          = 1996-12-18T12:00:00.331
USEABLE_START_TIME  = 1996-12-18T12:10:00.331
USEABLE_STOP_TIME   = 1996-12-28T21:23:00.331
STOP_TIME           = 1996-12-28T21:28:00.331
INTERPOLATION       = HERMITE
INTERPOLATION_DEGREE = 7
META_STOP
COMMENT This file was produced by M.R. Somebody, MSOO NAV/JPL, 1996NOV 04. It is
COMMENT to be used for DSN scheduling purposes only.

1996-12-18T12:00:00.331 2789.619 -280.045 -1746.755 4.73372 -2.49586 -1.04195
1996-12-18T12:01:00.331 2783.419 -308.143 -1877.071 5.18604 -2.42124 -1.99608
1996-12-18T12:02:00.331 2776.033 -336.859 -2008.682 5.63678 -2.33951 -1.94687
1996-12-28T21:28:00.331 -3881.024 563.959 -682.773 -3.28827 -3.66735 1.63861

META_START
OBJECT_NAME         = MARS GLOBAL SURVEYOR
OBJECT_ID           = 1996-062A
CENTER_NAME         = MARS BARYCENTER
REF_FRAME           = J2000
TIME_SYSTEM         = UTC
START_TIME          = 1996-12-28T21:29:07.267
USEABLE_START_TIME  = 1996-12-28T22:08:02.5
USEABLE_STOP_TIME   = 1996-12-30T01:18:02.5
STOP_TIME           = 1996-12-30T01:28:02.267
INTERPOLATION       = HERMITE
INTERPOLATION_DEGREE = 7
META_STOP

COMMENT This block begins after trajectory correction maneuver TCM-3.
1996-12-28T21:29:07.267 -2432.166 -063.042 1742.754 7.33702 -3.495867 -1.041945
1996-12-28T21:59:02.267 -2445.234 -878.141 1873.073 1.86043 -3.421256 -0.996366
1996-12-28T22:00:02.267 -2458.079 -683.858 2007.684 6.36786 -3.339563 -0.946654
1996-12-30T01:28:02.267 2164.375 1115.811 -688.131 -3.53328 -2.88452 0.88535

COVARIANCE_START
EPOCH = 1996-12-28T21:29:07.267
COV_REF_FRAME = EME2000
3.3313494e-04
4.6189273e-04 6.7824216e-04
-3.0700078e-04 -4.2212341e-04 3.2319319e-04
-3.3493650e-07 -4.6860842e-07 2.4849495e-07 4.2960228e-10
-2.2118325e-07 -2.8641868e-07 1.7980986e-07 2.6088992e-10 1.7675147e-10
-3.0413460e-07 -4.9894969e-07 3.5403109e-07 1.8692631e-10 1.0088625e-10 6.2244443e-10
COVARIANCE_STOP
"""

# 504.0-B-2, annex G, figure G-4
SURVEYOR = """CCSDS_AEM_VERS = 2.0
CREATION_DATE = 2002-11-04T17:22:31
ORIGINATOR = NASA/JPL
MESSAGE_ID = A7015Z3

META_START
COMMENT This file was produced by M.R. Somebody, MSOO NAV/JPL.
OBJECT_NAME     = MARS GLOBAL SURVEYOR
OBJECT_ID       = 1996-062A
CENTER_NAME     = MARS BARYCENTER
REF_FRAME_A     = EME2000
REF_FRAME_B     = SC_BODY_1
TIME_SYSTEM     = UTC
START_TIME      = 1996-11-28T21:29:07.2555
USEABLE_START_TIME = 1996-11-28T22:08:02.5555
USEABLE_STOP_TIME  = 1996-11-30T01:18:02.5555
STOP_TIME       = 1996-11-30T01:28:02.5555
ATTITUDE_TYPE   = QUATERNION
INTERPOLATION_METHOD = hermite
INTERPOLATION_DEGREE = 7
META_STOP

DATA_START
1996-11-28T21:29:07.2555 0.56748  0.03146  0.45689  0.68427
1996-11-28T22:08:03.5555 0.42319  -0.45697 0.23784  0.74533
1996-11-28T22:08:04.5555 -0.84532 0.26974  -0.06532 0.45652
DATA_STOP
"""

STATION = """CCSDS_OEM_VERS = 2.0
CREATION_DATE  = 2022-01-17T20:44:45.347
ORIGINATOR     = NASA/JSC/FOD/TOPO

META_START
OBJECT_NAME          = ISS
OBJECT_ID            = 1998-067-A
CENTER_NAME          = Earth
REF_FRAME            = EME2000
TIME_SYSTEM          = UTC
START_TIME           = 2022-01-17T12:00:00.000
USEABLE_START_TIME   = 2022-01-17T12:00:00.000
USEABLE_STOP_TIME    = 2022-01-18T12:00:00.000
STOP_TIME            = 2022-01-18T12:00:00.000
META_STOP

COMMENT Source: This file was produced by the TOPO office within FOD at JSC.
COMMENT MASS=458943.00
COMMENT
2022-01-17T12:59:50.000 4969.400891225 -2751.226477083 -3736.733470666 5.213377867402 3.613144039837 4.286556628497
2022-01-17T13:00:00.000 5021.218457183220 -2714.921344536780 -3693.631863364480 5.15002544728106 3.64780592200467 4.33367398742523
"""  # noqa: E501

AGAIN = """CCSDS_OEM_VERS = 2.0
CREATION_DATE = 2026-11-21T14:49:35
ORIGINATOR = RSO_LIDAR

META_START
OBJECT_NAME = ISS (X)
OBJECT_ID = 1998-067A
CENTER_NAME = EARTH
REF_FRAME = GCRF
TIME_SYSTEM = UTC
START_TIME = 2024-09-17T12:00:00.250
STOP_TIME = 2024-09-17T12:07:00.250
INTERPOLATION = HERMITE
INTERPOLATION_DEGREE = 7
META_STOP

2024-09-17T12:00:00.250000 5.40978616882000e+03 3.96667934345400e+03 9.21474886876000e+02 -3.50223351846500e+00 3.40009255137500e+00 5.92447785235600e+00
2024-09-17T12:01:00.250000 5.18731654585200e+03 4.16136412891200e+03 1.27454103583800e+03 -3.91056357355900e+00 3.08690088418700e+00 5.83986046790800e+00
2024-09-17T12:02:00.250000 4.94088006394600e+03 4.33682224764800e+03 1.62171845169900e+03 -4.30082024444500e+00 2.75945133560900e+00 5.72826271114600e+00
2024-09-17T12:03:00.250000 4.67161579925800e+03 4.49224345115300e+03 1.96140323648600e+03 -4.67119587565000e+00 2.41926186034800e+00 5.59020283170300e+00
2024-09-17T12:04:00.250000 4.38076854280300e+03 4.62691038119200e+03 2.29202629949900e+03 -5.01997567616500e+00 2.06790962656200e+00 5.42632236182300e+00
2024-09-17T12:05:00.250000 4.06968298444600e+03 4.74020190036900e+03 2.61206066545600e+03 -5.34554577876300e+00 1.70702356383300e+00 5.23738305803100e+00
2024-09-17T12:06:00.250000 3.73979742789100e+03 4.83159596803700e+03 2.92002858171100e+03 -5.64640080760500e+00 1.33827666640800e+00 5.02426326524100e+00
2024-09-17T12:07:00.250000 3.39263706731000e+03 4.90067204803500e+03 3.21450839046800e+03 -5.92115091679000e+00 9.63378090798000e-01 4.78795372239200e+00
"""  # noqa: E501


def utc(text):
    return datetime.datetime.fromisoformat(text).replace(tzinfo=datetime.UTC)


def saved(tmp_path, text):
    path = tmp_path / "some.txt"
    path.write_text(text)
    return str(path)


def test_the_example_about_mars_is_read_and_its_centre_refused(tmp_path):
    message = read_message(MARS, "OEM", "mars.oem")
    assert message.version == "3.0" and [len(segment.rows) for segment in message.segments] == [4, 4]
    path = saved(tmp_path, MARS)
    with pytest.raises(ScenarioError, match="CENTER_NAME MARS BARYCENTER; only EARTH"):
        Ephemeris(file=path).states(Epochs(utc("1996-12-20"), np.zeros(1)))
    # Taken as Earth's, its second segment begins where it is of use, which is 39 minutes after its first row.
    path = saved(tmp_path, MARS.replace("MARS BARYCENTER", "EARTH"))
    with pytest.warns(RsoLidarWarning, match="inside the Earth"):  # an orbit of Mars is
        span = Ephemeris(file=path).span_utc(utc("1996-12-20"))
    assert span == ("1996-12-18T12:10:00.331Z", "1996-12-30T01:18:02.500Z")


def test_the_example_of_an_attitude(tmp_path):
    # Figure G-4's second row; from version 2.0 on Q1 Q2 Q3 QC, from A to B.
    x, y, z, w = np.array([0.42319, -0.45697, 0.23784, 0.74533]) / 0.99999_5
    body_from_eme2000 = [
        [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
        [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
        [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
    ]
    orbit = Kepler(
        epoch_utc=utc("1996-11-28"),
        semi_major_axis_km=7000.0,
        eccentricity=0.0,
        inclination_deg=50.0,
        raan_deg=0.0,
        argument_of_perigee_deg=0.0,
        true_anomaly_deg=0.0,
    )
    law = AttitudeTable(file=saved(tmp_path, SURVEYOR), interpolation="slerp")
    epochs = Epochs(utc("1996-11-28T22:08:03"), np.array([0.5555]))
    made = truth([Body(name="mgs", motion=orbit, attitude=law)], epochs)
    turn = made.pose("inertial", "mgs").rotation.as_matrix().reshape(3, 3)
    expected = gcrs_from_eme2000() @ np.array(body_from_eme2000).T
    np.testing.assert_allclose(turn, expected, atol=3e-5)  # the row's own norm is 0.99999


def test_the_direction_of_a_quaternion_is_others_too(tmp_path):
    # brahe 1.8.0 reads this row of ours as this quaternion, and has this direction cosine matrix, body from inertial, of it.
    row = "0.561136001976536 0.537820994941508 -0.450266786557129 0.439471029317556"
    theirs = [
        [0.0160168, 0.20782303, -0.9780353],
        [0.99933986, -0.03522758, 0.00888017],
        [-0.03260832, -0.9775319, -0.20825007],
    ]
    head, _, _ = SURVEYOR.partition("DATA_START\n")
    head = head.replace("EME2000", "GCRF")
    text = head + "DATA_START\n" + f"1996-11-28T21:00:00 {row}\n1996-11-28T22:00:00 {row}\nDATA_STOP\n"
    lines = [line for line in text.splitlines() if not line.startswith(("START", "STOP", "USEABLE"))]
    law = AttitudeTable(file=saved(tmp_path, "\n".join(lines) + "\n"))
    orbit = Kepler(
        epoch_utc=utc("1996-11-28"),
        semi_major_axis_km=7000.0,
        eccentricity=0.0,
        inclination_deg=50.0,
        raan_deg=0.0,
        argument_of_perigee_deg=0.0,
        true_anomaly_deg=0.0,
    )
    made = truth([Body(name="a", motion=orbit, attitude=law)], Epochs(utc("1996-11-28T21:30:00"), np.zeros(1)))
    turn = made.pose("a", "inertial").rotation.as_matrix().reshape(3, 3)
    np.testing.assert_allclose(turn, theirs, atol=1e-8)


def test_the_space_station_stands_in_gcrs(tmp_path):
    motion = Ephemeris(file=saved(tmp_path, STATION), object="1998-067-a")
    state = motion.states(Epochs(utc("2022-01-17T12:00:00"), np.array([3600.0])))
    raw_m = np.array([5021218.457183220, -2714921.344536780, -3693631.863364480])
    # ERFA's bp00 (IAU 2000): EME2000 from GCRS less the identity, transposed, takes the raw place this far
    bias = np.array(
        [
            [0.0, -7.0782797441991980e-08, 8.0562171469761338e-08],
            [7.0782794778573375e-08, 0.0, 3.3060414542221364e-08],
            [-8.0562173809869717e-08, -3.3060408839805517e-08, 0.0],
        ]
    )
    np.testing.assert_allclose(state.position_m[0] - raw_m, bias.T @ raw_m, atol=1e-5)
    assert np.linalg.norm(bias.T @ raw_m) > 0.3  # it matters: 23 mas of 6800 km, less toward its axis
    # speed and distance are no matter of frames
    assert np.linalg.norm(state.position_m[0]) == pytest.approx(np.linalg.norm(raw_m), rel=1e-14)


def test_rows_that_another_package_writes_again(tmp_path):
    # The states of two-body flight that we wrote, read and written by `oem` 0.4.5; between rows it gives, with its own
    # Hermite of degree 7, this place at 12:03:24.250.
    motion = Ephemeris(file=saved(tmp_path, AGAIN))
    start = datetime.datetime(2024, 9, 17, 12, 0, 0, 250000, tzinfo=datetime.UTC)
    theirs_m = np.array([4557.79372533e3, 4548.6377081e3, 2094.82639974e3])
    got = motion.states(Epochs(start, np.array([204.0])))
    np.testing.assert_allclose(got.position_m[0], theirs_m, atol=1e-5 + 5e-6)  # their printed digits: 1e-8 km
    orbit = Kepler(
        epoch_utc=start,
        semi_major_axis_km=6778.0,
        eccentricity=0.001,
        inclination_deg=51.6,
        raan_deg=30.0,
        argument_of_perigee_deg=10.0,
        true_anomaly_deg=0.0,
    )
    epochs = Epochs(start, np.linspace(0.0, 420.0, 43))
    np.testing.assert_allclose(motion.states(epochs).position_m, orbit.states(epochs).position_m, atol=1e-6)
    np.testing.assert_allclose(motion.states(epochs).velocity_m_s, orbit.states(epochs).velocity_m_s, atol=1e-7)
