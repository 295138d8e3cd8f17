import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.optics import BrownConrady, ZemaxDistortion

HALF = 64 * 340.94e-6  # tangent of half the field of Fuller et al.: 64 pixels of 340.94 urad (2.5 degrees)
PIXEL = 340.94e-6
WIDE = BrownConrady(k1=-0.12, k2=0.03, k3=-0.004, p1=0.002, p2=-0.003)


def field(half, n=41):
    return np.meshgrid(np.linspace(-half, half, n), np.linspace(-half, half, n))


@pytest.mark.parametrize(
    ("lens", "half"),
    [
        (BrownConrady(), HALF),
        (BrownConrady(k1=5.2), HALF),
        (BrownConrady(k1=-5.2, k2=300.0, p1=0.05, p2=-0.02), HALF),
        (WIDE, math.tan(math.radians(35))),
    ],
)
def test_undistort_undoes_distort(lens, half):
    x, y = field(half)
    lens.check(half, half)
    back = lens.undistort(*lens.distort(x, y))
    assert np.abs(back[0] - x).max() < 1e-12 and np.abs(back[1] - y).max() < 1e-12
    there = lens.distort(*lens.undistort(x, y))
    assert np.abs(there[0] - x).max() < 1e-12 and np.abs(there[1] - y).max() < 1e-12


def test_the_formula_by_hand():
    """Brown-Conrady at x = 0.3, y = -0.2: r² = 0.13; each coefficient by itself, worked out by hand."""
    x, y = 0.3, -0.2
    for name, (dx, dy) in {
        "k1": (0.3 * 0.13, -0.2 * 0.13),
        "k2": (0.3 * 0.0169, -0.2 * 0.0169),
        "k3": (0.3 * 0.002197, -0.2 * 0.002197),
        "p1": (2 * -0.06, 0.13 + 2 * 0.04),
        "p2": (0.13 + 2 * 0.09, 2 * -0.06),
    }.items():
        xd, yd = BrownConrady(**{name: 0.5}).distort(x, y)
        assert xd - x == pytest.approx(0.5 * dx, abs=1e-15)
        assert yd - y == pytest.approx(0.5 * dy, abs=1e-15)


def test_half_a_percent_at_the_corner_of_the_seed_lens():
    """k1 = D / r² (instrument notes, section 6): 0.5 % at r = 0.031 is k1 = 5.2, and 0.45 pixels at the corner."""
    corner = math.sqrt(2) * HALF
    assert corner == pytest.approx(0.031, abs=2e-4)
    assert 0.005 / corner**2 == pytest.approx(5.2, abs=0.1)
    xd, _ = BrownConrady(k1=0.005 / corner**2).distort(np.array(corner), np.array(0.0))
    assert float(xd - corner) / PIXEL == pytest.approx(0.45, abs=0.005)


def test_signs_of_barrel_and_pincushion():
    x = np.array([0.1])
    assert BrownConrady(k1=-0.5).distort(x, 0 * x)[0] < x < BrownConrady(k1=0.5).distort(x, 0 * x)[0]


def test_area_is_the_jacobian():
    half = 0.5
    xd, yd = field(half, 11)
    step = 1e-5
    ax, ay = WIDE.undistort(xd + step, yd)
    bx, by = WIDE.undistort(xd - step, yd)
    cx, cy = WIDE.undistort(xd, yd + step)
    dx, dy = WIDE.undistort(xd, yd - step)
    determinant = ((ax - bx) * (cy - dy) - (ay - by) * (cx - dx)) / (4 * step**2)
    # Central differences: third derivatives of order 1 times step², and 1e-13 / step of rounding.
    assert np.abs(WIDE.area(xd, yd) - determinant).max() < 1e-7
    assert np.abs(WIDE.area(xd, yd) - 1).max() > 0.05
    x, y = WIDE.undistort(xd, yd)
    assert np.allclose(WIDE.area_at_direction(x, y), WIDE.area(xd, yd), rtol=0, atol=1e-14)


def test_area_integrates_to_what_the_focal_plane_sees():
    """The area inside the image of the focal plane's edge (Green's theorem) is the integral of `area` (Gauss-Legendre)."""
    half = 0.5
    node, weight = np.polynomial.legendre.leggauss(24)
    xd, yd = np.meshgrid(half * node, half * node)
    inside = half**2 * np.sum(WIDE.area(xd, yd) * weight * weight[:, None])
    t = np.linspace(-half, half, 20001)
    one = np.full_like(t, half)
    x, y = WIDE.undistort(np.concatenate([t, one, -t, -one]), np.concatenate([-one, t, one, -t]))
    around = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    assert inside == pytest.approx(around, rel=1e-8)


def test_a_fold_is_refused():
    # k1 = -1 turns round at r = 1/sqrt(3) = 0.577, where the image is at 0.385.
    lens = BrownConrady(k1=-1.0)
    lens.check(0.25, 0.25)
    with pytest.raises(ScenarioError, match="k1, k2"):
        lens.check(0.3, 0.3)
    with pytest.raises(ScenarioError, match="no direction is imaged"):
        lens.undistort(np.array([0.5]), np.array([0.0]))
    with pytest.raises(ScenarioError, match="k1, k2"):
        BrownConrady(k1=-5000.0).check(HALF, HALF)


def test_values_are_checked():
    with pytest.raises(ScenarioError, match="k4"):
        BrownConrady(k4=1.0)
    with pytest.raises(ScenarioError, match="k1"):
        BrownConrady(k1="0.1")


def listing(path, lens, half_deg=2.0, n=6, f_mm=293.3, noise=lambda i, j: (0.0, 0.0), shift=(0.0, 0.0), rim=None):
    """Write a Grid Distortion listing as Zemax lays it out: y upwards."""
    lines = [
        "Listing of Grid Distortion Data",
        "",
        "Units are Millimeters.",
        "Field units are degrees",
        "Wavelength: 1.06400 µm",
        "",
        "   i    j   X-Field   Y-Field   R-Field   Predicted X   Predicted Y   Real X   Real Y   Distortion",
    ]
    for j in range(-n, n + 1):
        for i in range(-n, n + 1):
            fx, fy = half_deg * i / n, half_deg * j / n
            x, y = math.tan(math.radians(fx)), math.tan(math.radians(fy))
            xd, yd = lens.distort(np.array(x), np.array(-y))
            ex, ey = noise(i, j)
            px, py = f_mm * x, f_mm * y
            if rim == "ftheta":
                px, py = f_mm * math.radians(fx), f_mm * math.radians(fy)
            real = f_mm * float(xd) + ex + shift[0], -f_mm * float(yd) + ey + shift[1]
            numbers = fx, fy, math.hypot(fx, fy), px, py, *real
            lines.append(f"{i:5d}{j:5d}" + "".join(f" {value:.9E}" for value in numbers) + "   0.1%")
    lines += [
        "",
        "Maximum distortion: 0.1%",
        "Predicted coordinate ABCD matrix:",
        "A =    2.93e+002",
        "SMIA TV Distortion 0.1%",
    ]
    path.write_text("\n".join(lines), encoding="latin-1")
    return ZemaxDistortion(file=str(path))


def test_a_listing_gives_its_coefficients_back(tmp_path):
    truth = BrownConrady(k1=5.2, k2=-40.0, p1=0.004, p2=-0.006)
    lens = listing(tmp_path / "grid.txt", truth, shift=(0.02, -0.01))
    assert lens.fit.focal_length_m == pytest.approx(0.2933, rel=1e-7)
    # Ten digits over a field of 0.05: 1e-10 of x and of x r² (2e-3) leave 1e-6 of k1.
    assert lens.coefficients[0] == pytest.approx(5.2, rel=1e-4)
    assert lens.coefficients[3:] == pytest.approx((0.004, -0.006), rel=1e-4)
    x, y = field(HALF)
    for a, b in zip(lens.distort(x, y), truth.distort(x, y), strict=True):
        assert np.abs(a - b).max() / PIXEL < 1e-4
    assert lens.fit.rms_tangent / PIXEL < 1e-4
    lens.check(HALF, HALF)
    with pytest.raises(ScenarioError, match="wider field"):
        lens.check(0.05, 0.05)


def test_the_residual_of_a_fit_is_measured(tmp_path):
    rng = np.random.default_rng(3)
    points = rng.normal(0.0, 0.01, (13, 13, 2))  # mm, in each axis
    lens = listing(tmp_path / "grid.txt", BrownConrady(k1=5.2), noise=lambda i, j: points[i + 6, j + 6])
    # 338 numbers less 7 fitted: their rms is known to 1 / sqrt(2 * 331) = 3.9 %; four of these sigmas.
    expected = math.sqrt(2) * 0.01 / 293.3 / PIXEL
    assert lens.fit.rms_tangent / PIXEL == pytest.approx(expected * math.sqrt(331 / 338), rel=0.16)


def test_a_lens_that_is_not_brown_conrady_is_refused(tmp_path):
    bent = listing(tmp_path / "bent.txt", BrownConrady(), noise=lambda i, j: (0.6 * (-1) ** i, 0.0))
    with pytest.raises(ScenarioError, match="% of the field"):
        bent.distort(np.zeros(1), np.zeros(1))
    ftheta = listing(tmp_path / "ftheta.txt", BrownConrady(), half_deg=30.0, rim="ftheta")
    with pytest.raises(ScenarioError, match="F-Theta"):
        ftheta.check(HALF, HALF)


def test_a_changed_file_is_read_again(tmp_path):
    lens = listing(tmp_path / "grid.txt", BrownConrady(k1=1.0))
    assert lens.coefficients[0] == pytest.approx(1.0, rel=1e-3)
    listing(tmp_path / "grid.txt", BrownConrady(k1=-12.0), n=5)
    assert lens.coefficients[0] == pytest.approx(-12.0, rel=1e-3)
