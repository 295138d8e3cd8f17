import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.optics import AiryPsf, FieldDependentPsf, FieldPsf, GaussianPsf, GridPsf, ZemaxPsf
from rso_lidar.optics.lens.hat_weights import encircled_energy
from rso_lidar.optics.lens.psf import find_reach, pixel_shares, psf_files

SEED = {"pitch_m": 100e-6, "wavelength_m": 1064e-9, "f_number": 2.8}  # the lens of Fuller et al., sec. 5
BLUR_M = 1064e-9 * 2.8
HALO = {"halo_fraction": 0.01, "halo_radius_um": 150.0}


def erf_between(low, high, sigma):
    return 0.5 * (math.erf(high / sigma / math.sqrt(2)) - math.erf(low / sigma / math.sqrt(2)))


def smeared(low, high, cell, sigma, points=40):
    """The share of a Gaussian about a point of `cell` that lies in [low, high], averaged over the cell (Gauss-Legendre)."""
    node, weight = np.polynomial.legendre.leggauss(points)
    at = 0.5 * (cell[0] + cell[1]) + 0.5 * (cell[1] - cell[0]) * node
    return sum(0.5 * w * erf_between(low - x, high - x, sigma) for x, w in zip(at, weight, strict=True))


@pytest.mark.parametrize("sigma", [5.0, 20.0, 70.0])
def test_gaussian_against_the_error_function(sigma):
    shares = pixel_shares(GaussianPsf(sigma_um=sigma), sub=4, reach=4, **SEED)
    for i, j in [(0, 0), (1, 3), (2, 2)]:
        cells = [(25.0 * i, 25.0 * i + 25), (25.0 * j, 25.0 * j + 25)]
        for dr, dc in [(0, 0), (-1, 0), (0, 1), (1, -1), (2, 0)]:
            exact = math.prod(
                smeared(100.0 * d, 100.0 * d + 100, cell, sigma) for d, cell in zip((dr, dc), cells, strict=True)
            )
            assert shares[i, j, 4 + dr, 4 + dc] == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("sigma", [15.0, 30.0])
def test_ensquared_energy_of_a_gaussian(sigma):
    """A point in the middle of a pixel of pitch p puts erf(p / (2 sqrt 2 sigma))² into it; 25 cells hardly smear it."""
    shares = pixel_shares(GaussianPsf(sigma_um=sigma), sub=25, reach=3, **SEED)
    # A cell of 4 um smears by 4² / 12 = 1.3 um² of variance.
    exact = math.erf(100 / (2 * math.sqrt(2) * math.hypot(sigma, 4 / math.sqrt(12)))) ** 2
    assert shares[12, 12, 3, 3] == pytest.approx(exact, abs=2e-5)


def test_airy_encircled_energy():
    """83.8 % within the first dark ring, at 1.22 λN = 3.6 um for f/2.8 and 1064 nm; 91.0 % within the second."""
    first = 1.21967 * BLUR_M  # Born & Wolf 8.5, table 8.2
    assert first == pytest.approx(3.6e-6, abs=0.05e-6)
    assert encircled_energy(first, BLUR_M) == pytest.approx(0.838, abs=5e-4)
    assert encircled_energy(2.23313 * BLUR_M, BLUR_M) == pytest.approx(0.910, abs=5e-4)
    assert encircled_energy(np.zeros(1), BLUR_M) == 0


def airy_by_transform(pitch_m, sub, reach, n_pixels=64):
    """Shares from the optical transfer function of a round pupil (Goodman 6-31), summed as a Fourier series."""
    step = pitch_m / sub
    period = n_pixels * pitch_m  # the light that wraps round is what lies beyond, evenly spread
    f = np.arange(0, int(period / BLUR_M) + 1) / period
    rho = np.minimum(np.hypot(f, f[:, None]) * BLUR_M, 1.0)
    otf = 2 / math.pi * (np.arccos(rho) - rho * np.sqrt(1 - rho**2))
    twice = np.where(f > 0, 2.0, 1.0)
    hats = otf * np.multiply.outer(twice, twice) * np.sinc(f * step) ** 2 * np.sinc(f * step)[:, None] ** 2
    # Sum the cosine series at multiples of the step.
    m = np.arange((reach + 1) * sub + 1) * step
    cosines = np.cos(2 * math.pi * m[:, None] * f)
    quadrant = np.einsum("af,bg,fg->ab", cosines, cosines, hats, optimize=True) * (step / period) ** 2
    half = np.concatenate([quadrant[:0:-1], quadrant])
    full = np.concatenate([half[:, :0:-1], half], axis=1)
    middle = (reach + 1) * sub
    shares = np.zeros((sub, sub, 2 * reach + 1, 2 * reach + 1))
    for i, j, r, c in np.ndindex(shares.shape):
        top, left = middle + (r - reach) * sub - i, middle + (c - reach) * sub - j
        shares[i, j, r, c] = full[top : top + sub, left : left + sub].sum()
    return shares


def test_airy_against_its_transfer_function():
    exact = airy_by_transform(100e-6, 4, 1)
    shares = pixel_shares(AiryPsf(), sub=4, reach=1, **SEED)
    missed = 1 - exact.sum(axis=(2, 3))  # 2 λN / (π² r) beyond some 125 um: about half a percent
    assert 0.002 < missed.min() and missed.max() < 0.012
    # Wrapped light is 2 λN / (π² 3.2 mm) = 2e-4 over 64² pixels; rings are cut at an eighth of a step.
    assert np.abs(shares * exact.sum(axis=(2, 3), keepdims=True) - exact).max() < 2e-4


@pytest.mark.parametrize(
    "psf", [GaussianPsf(sigma_um=1e-3), GaussianPsf(sigma_um=40.0), AiryPsf(), GaussianPsf(sigma_um=40.0, **HALO)]
)
@pytest.mark.parametrize(("sub", "reach"), [(1, 1), (4, 2), (5, 3)])
def test_energy_is_conserved(psf, sub, reach):
    shares = pixel_shares(psf, sub=sub, reach=reach, **SEED)
    assert shares.shape == (sub, sub, 2 * reach + 1, 2 * reach + 1)
    assert np.abs(shares.sum(axis=(2, 3)) - 1).max() < 1e-12
    assert shares.min() >= 0 and not shares.flags.writeable
    # The same seen in a mirror, up to the rounding of differences.
    assert np.allclose(shares, shares[::-1, :, ::-1], atol=1e-12)
    assert np.allclose(shares, shares.transpose(1, 0, 3, 2), atol=1e-9 if psf.type == "gaussian" else 1e-4)


def test_a_sharp_kernel_stays_in_its_pixel():
    shares = pixel_shares(GaussianPsf(sigma_um=1e-3), sub=4, reach=1, **SEED)
    assert np.abs(shares[1:3, 1:3, 1, 1] - 1).max() < 1e-9
    assert shares[0, 0, 0, 0] < 1e-6  # only a sliver along the edges leaves a cell


def test_the_halo():
    """Encircled energy of the halo is 1 - R / sqrt(R² + r²): 1 - 1/sqrt(2) = 29.3 % within R."""
    psf = GaussianPsf(sigma_um=1e-3, halo_fraction=1.0, halo_radius_um=150.0)
    reach = 12
    shares = pixel_shares(psf, sub=1, reach=reach, **SEED)[0, 0]
    offset = np.arange(-reach, reach + 1) * 100.0
    # Averages of the profile over pixel pairs, by midpoints 20 x 20 of a pixel smeared by a pixel (a triangle).
    t = (np.arange(40) - 19.5) * 5.0
    tent = np.clip(1 - np.abs(t) / 100, 0, None) * 5.0
    for r, c in [(reach, reach), (reach, reach + 1), (reach + 3, reach - 2), (2, 2)]:
        x, y = offset[c] + t, (offset[r] + t)[:, None]
        profile = 150.0 / (2 * math.pi) * (150.0**2 + x * x + y * y) ** -1.5
        # What lies beyond the square was shared out: its share, from the solid angle of a square.
        a = (reach + 0.5) * 100.0
        within = 2 / math.pi * math.atan(a * a / (150.0 * math.sqrt(150.0**2 + 2 * a * a)))
        # The smeared centre widens the edge by less than 1e-3 of it.
        assert shares[r, c] == pytest.approx(np.sum(profile * tent * tent[:, None]) / within, rel=2e-3)
    dim = pixel_shares(GaussianPsf(sigma_um=5.0, **HALO), sub=1, reach=3, **SEED)[0, 0]
    bare = pixel_shares(GaussianPsf(sigma_um=5.0), sub=1, reach=3, **SEED)[0, 0]
    assert bare[3, 5] < 1e-12 and 1e-5 < dim[3, 5] < 1e-3  # what decides whether a retro blinds its neighbours


def test_reach():
    assert find_reach(GaussianPsf(sigma_um=1.0), missed=1e-2, **SEED) == 1  # light at the edge leaves, 2 x 2 x 0.4 um
    assert find_reach(GaussianPsf(sigma_um=1e-3), missed=1e-4, **SEED) == 0
    wide = GaussianPsf(sigma_um=200.0)
    # Averaged over a pixel the light is spread as a Gaussian of variance 200² + 2 * 100²/12, roughly: n + 1/2 pixels.
    reach = find_reach(wide, **SEED)
    sigma = math.sqrt(200**2 + 100**2 / 12)
    lost = [1 - math.erf((n + 0.5) * 100 / sigma / math.sqrt(2)) ** 2 for n in (reach - 1, reach)]
    assert lost[1] < 1.1e-4 and lost[0] > 0.9e-4
    assert find_reach(GaussianPsf(sigma_um=5.0, **HALO), missed=1e-9, **SEED) == 16
    reaches = [find_reach(AiryPsf(), missed=missed, **SEED) for missed in (1e-2, 2e-3, 5e-4)]
    assert reaches == sorted(reaches) and reaches[0] == 1 and reaches[-1] > 3


def save(path, values, between=","):
    path.write_text("\n".join(between.join(f"{v:.8e}" for v in row) for row in values))
    return path


def gaussian_table(sigma, spacing, n):
    x = (np.arange(n) - 0.5 * (n - 1)) * spacing
    return np.exp(-0.5 * (x / sigma) ** 2)[:, None] * np.exp(-0.5 * (x / sigma) ** 2)


@pytest.mark.parametrize(("spacing", "n"), [(2.0, 121), (4.0, 60), (10.0, 25)])
def test_a_measured_grid(tmp_path, spacing, n):
    """A Gaussian as a table of squares is one of variance sigma² + spacing²/12."""
    file = save(tmp_path / "grid.csv", 7.0 * gaussian_table(25.0, spacing, n))
    shares = pixel_shares(GridPsf(file=str(file), spacing_um=spacing), sub=4, reach=2, **SEED)
    exact = pixel_shares(GaussianPsf(sigma_um=math.hypot(25.0, spacing / math.sqrt(12))), sub=4, reach=2, **SEED)
    assert np.abs(shares - exact).max() < 3e-4
    assert np.abs(shares.sum(axis=(2, 3)) - 1).max() < 1e-12


@pytest.mark.parametrize(
    "text", ["0 0 0\n0 1 0\n0 0 0", "0,0;0,0;0,0\n0,0;2,5;0,0\n0,0;0,0;0,0\n", "#a\n0\t0\t0\n0\t3\t0\n0\t0\t0"]
)
def test_tables_in_other_hands(tmp_path, text):
    file = tmp_path / "grid.txt"
    file.write_text(text)
    psf = GridPsf(file=str(file), spacing_um=100.0)
    # One square of a pixel's size: a cell of 1/2 at the corner spreads over (1/4, 3/4) of a pixel in each axis.
    shares = pixel_shares(psf, sub=2, reach=1, **SEED)
    assert shares[0, 0, 1, 1] == pytest.approx(0.75**2, abs=1e-3)
    assert shares[0, 0, 0, 1] == pytest.approx(0.25 * 0.75, abs=1e-3)
    assert psf_files(psf) == (str(file),)


def spot(path, row, col, n=41, spacing="5.0"):
    """A Huygens listing of one bright point, its center point in the middle."""
    values = np.zeros((n, n))
    values[row, col] = 1.0
    head = [
        "Listing of Huygens PSF Data",
        f"Data spacing is {spacing} µm.",
        f"Center point is: {n // 2 + 1}, {n // 2 + 1}",
    ]
    body = ["\t".join(f"{v:.3E}" for v in line) for line in values]
    path.write_text("\n".join(head + body), encoding="utf-16")
    return ZemaxPsf(file=str(path))


def test_a_zemax_listing_keeps_its_rows_and_columns(tmp_path):
    psf = spot(tmp_path / "psf.txt", 0, 20)  # 100 um above the middle, and that is the pixel above
    shares = pixel_shares(psf, sub=4, reach=1, **SEED)
    assert shares[1, 1, 0, 1] > 0.85 and shares[1, 1, 2, 1] == 0
    turned = pixel_shares(psf, sub=4, reach=1, field_rad=0.1, azimuth_rad=1.0, **SEED)
    assert np.array_equal(turned, shares)  # one kernel serves the whole field, as it stands


def test_field_dependence(tmp_path):
    axis = GaussianPsf(sigma_um=10.0)
    corner = spot(tmp_path / "corner.txt", 0, 20)
    psf = FieldDependentPsf(fields=(FieldPsf(field_deg=0.5, psf=axis), FieldPsf(field_deg=1.5, psf=corner)))

    def at(field_deg, azimuth_deg=-90.0):
        where = {"field_rad": math.radians(field_deg), "azimuth_rad": math.radians(azimuth_deg)}
        return pixel_shares(psf, sub=4, reach=2, **where, **SEED)

    first, last = (pixel_shares(kernel, sub=4, reach=2, **SEED) for kernel in (axis, corner))
    for field_deg, share in [(0, 0), (0.5, 0), (0.75, 0.25), (1.0, 0.5), (1.5, 1), (40, 1)]:
        assert np.allclose(at(field_deg), (1 - share) * first + share * last, rtol=0, atol=1e-9)
    # The top of the listing points away from the axis: azimuth 0 is right, 90 down, 180 left.
    right, down, left = (at(1.5, azimuth)[1, 1] for azimuth in (0, 90, 180))
    assert right[2, 3] > 0.85 and down[3, 2] > 0.85 and left[2, 1] > 0.85
    assert np.allclose(at(1.5, 0), last.transpose(1, 0, 3, 2)[:, ::-1, :, ::-1], rtol=0, atol=1e-9)
    # Half-way between right and down, the spot 100 um off lies 71 um right and down: light of the last cell goes there.
    assert at(1.5, 45)[2, 2, 3, 3] == pytest.approx(1, abs=1e-9)
    assert np.abs(at(1.1, 33).sum(axis=(2, 3)) - 1).max() < 1e-12
    assert psf_files(psf) == (corner.file,)
    assert find_reach(psf, field_rad=0.03, **SEED) >= 1


def test_a_changed_file_is_read_again(tmp_path):
    psf = spot(tmp_path / "psf.txt", 0, 20)
    before = pixel_shares(psf, sub=2, reach=1, **SEED)
    spot(tmp_path / "psf.txt", 40, 20, spacing="5.00")
    after = pixel_shares(psf, sub=2, reach=1, **SEED)
    assert np.allclose(after, before[::-1, :, ::-1], atol=1e-12) and not np.allclose(after, before)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "is empty"),
        (b"1,2\n3", "line 2: has 1 numbers"),
        (b"1,2\n3,x", "line 2: is not a row of numbers"),
        (b"0,0\n0,0", "all its values are zero"),
        (b"1,2\n-3,1", "line 2: contains a negative"),
        (b"1,2\nnan,1", "line 2: contains a value that is not finite"),
        (b"1,2,3", "needs rows and columns"),
        (b"# nothing", "no rows of numbers"),
        (b"\x89PNG\x00\x01\x02\x03", "is not text"),
    ],
)
def test_broken_tables(tmp_path, content, told):
    file = tmp_path / "grid.csv"
    file.write_bytes(content)
    with pytest.raises(ScenarioError) as caught:
        pixel_shares(GridPsf(file=str(file), spacing_um=5.0), sub=2, reach=1, **SEED)
    assert str(caught.value).startswith(f"{file}: ") and told in str(caught.value) and "\n" not in str(caught.value)


def test_a_bad_file_far_out_is_told_on_the_axis(tmp_path):
    kernels = GaussianPsf(sigma_um=10.0), ZemaxPsf(file=str(tmp_path / "none.txt"))
    psf = FieldDependentPsf(fields=tuple(FieldPsf(field_deg=float(k), psf=kernel) for k, kernel in enumerate(kernels)))
    with pytest.raises(ScenarioError, match="no such file"):
        pixel_shares(psf, sub=2, reach=1, **SEED)


def test_bad_settings():
    for bad, told in [
        ({"sigma_um": 0.0}, "sigma_um"),
        ({"sigma_um": 5.0, "halo_fraction": 0.1}, "halo_radius_um"),
        ({"sigma_um": 5.0, "halo_radius_um": 10.0}, "does nothing"),
        ({"sigma_um": 5.0, "halo_fraction": 1.1, "halo_radius_um": 10.0}, "halo_fraction"),
    ]:
        with pytest.raises(ScenarioError, match=told):
            GaussianPsf(**bad)
    entry = FieldPsf(field_deg=1.0, psf=AiryPsf())
    with pytest.raises(ScenarioError, match="do not ascend"):
        FieldDependentPsf(fields=(entry, entry))
    with pytest.raises(ScenarioError, match="fields"):
        FieldDependentPsf(fields=())
    with pytest.raises(ScenarioError, match="lands within"):
        pixel_shares(GaussianPsf(sigma_um=5000.0), sub=2, reach=3, **SEED)
