import datetime

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar.orbit import Epochs, itrs_from_gcrs

UTC = datetime.UTC


def test_a_published_reduction():
    # Vallado, Fundamentals of Astrodynamics and Applications, 4th ed., example 3-14: 2004-04-06 07:51:28.386009 UTC,
    # r_GCRF to r_TIRS (before polar motion), with UT1 - UTC = -0.4399619 s. The built-in UT1 may differ by 0.5 ms, 0.3 m
    # here; with that turned back, 5 mm remain for the printed digits and the 10 uas of the two nutation series.
    epochs = Epochs(datetime.datetime(2004, 4, 6, 7, 51, 28, 386009, tzinfo=UTC), np.zeros(1))
    gcrf_m = 1e3 * np.array([5102.5089580, 6123.0114007, 6378.1369282])
    tirs_m = 1e3 * np.array([-1033.4750312, 7901.3055856, 6380.3445327])
    turned = np.einsum("ij,j->i", itrs_from_gcrs(epochs)[0], gcrf_m)
    np.testing.assert_allclose(turned, tirs_m, atol=0.3)
    late_s = float(epochs.skyfield_time().dut1[0]) + 0.4399619
    back = Rotation.from_rotvec([0.0, 0.0, 7.292115e-5 * late_s])
    np.testing.assert_allclose(back.apply(turned), tirs_m, atol=5e-3)


def test_it_is_a_rotation_that_turns_once_a_sidereal_day():
    start = datetime.datetime(2024, 9, 17, 12, tzinfo=UTC)
    matrix = itrs_from_gcrs(Epochs(start, np.array([0.0, 86164.0989])))  # Aoki et al. 1982: mean sidereal day
    product = np.einsum("kij,klj->kil", matrix, matrix)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-14)
    # a day's precession and nutation: below an arcsecond
    np.testing.assert_allclose(matrix[1], matrix[0], atol=5e-6)


def test_an_epoch_has_the_same_bits_among_many():
    start = datetime.datetime(2024, 9, 17, 12, tzinfo=UTC)
    time_s = np.linspace(0.0, 5400.0, 37)
    many = itrs_from_gcrs(Epochs(start, time_s))
    for k in (0, 7, 36):
        np.testing.assert_array_equal(itrs_from_gcrs(Epochs(start, time_s[k : k + 1]))[0], many[k])
