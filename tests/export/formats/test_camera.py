"""A camera from lines of sight: the receiver's own numbers come back."""

import numpy as np
import pytest
from frames_for_tests import line_of_sight

from rso_lidar.export import fit_camera
from rso_lidar.optics import BrownConrady, Receiver


@pytest.mark.parametrize(("rows", "cols", "fov_deg"), [(128, 128, 2.5), (64, 128, 20.0), (5, 3, 1.0), (1, 16, 2.0)])
def test_a_pinhole_is_found(rows, cols, fov_deg):
    receiver = Receiver(fov_deg=fov_deg, f_number=2.8, n_rows=rows, n_cols=cols)
    camera = fit_camera(receiver.line_of_sight)
    # Unit vectors are rounded to 1e-16 of a field 0.02 to 0.2 wide over some 100 pixels; a few digits go in the solution.
    assert camera.focal_px == pytest.approx(receiver.focal_length_m / receiver.pixel_pitch_m, rel=1e-11)
    assert camera.centre_px == pytest.approx(((cols - 1) / 2, (rows - 1) / 2), abs=1e-9)
    assert camera.distortion == (0.0,) * 5
    assert camera.error_px < 1e-9
    assert camera.matrix[0] == camera.matrix[4] == camera.focal_px


def test_a_lens_that_bends_is_found():
    lens = BrownConrady(k1=-0.3, k2=0.1, k3=0.25, p1=1e-3, p2=-2e-3)
    receiver = Receiver(fov_deg=40, f_number=2.8, distortion=lens)
    camera = fit_camera(receiver.line_of_sight)
    assert camera.error_px < 1e-7  # undistorted by Newton's method to 1e-12 of the tangent, times 176 px
    assert camera.focal_px == pytest.approx(receiver.focal_length_m / receiver.pixel_pitch_m, rel=1e-7)
    assert camera.distortion == pytest.approx((-0.3, 0.1, 1e-3, -2e-3, 0.25), abs=1e-5)


def test_a_lens_that_no_polynomial_describes_says_so():
    shape = (32, 32)
    sight = line_of_sight(shape) + 1e-3 * np.random.default_rng(1).normal(size=(*shape, 3))
    sight /= np.linalg.norm(sight, axis=-1, keepdims=True)
    assert fit_camera(sight).error_px > 0.1  # 1e-3 rad are 0.6 px


def test_one_pixel_tells_no_focal_length():
    camera = fit_camera(line_of_sight((1, 1)))
    assert camera.focal_px == 0.0 and camera.centre_px == (0.0, 0.0)
