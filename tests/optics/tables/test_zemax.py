import math

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.optics.tables.zemax import read_grid_distortion, read_huygens_psf

HEAD = [
    "Listing of Huygens PSF Data",
    "",
    "File : C:\\lenses\\flash_MTF.zmx",
    "Title: flash lidar, distortion below 0.1 %",
    "Date : 2024-09-17",
    "",
    "",
    "Polychromatic Huygens PSF",
    "",
    "1.0600 to 1.0680 µm at 0.0000, 1.2500 (deg).",
    "Data spacing is 2.500 µm.",
    "Data area is 20.000 by 20.000 µm.",
    "Strehl ratio: 0.913",
    "Pupil grid size: 128 by 128",
    "Image grid size: 8 by 8",
    "Center point is: 5, 4",
    "Center coordinates: 0.00000000E+000, 6.40000000E+000 Millimeters",
    "Centroid coordinates: 1.0E-005, 6.40010000E+000 Millimeters",
    "",
    "Values are relative intensity in linear scale.",
    "",
]
GRID = np.random.default_rng(5).uniform(0, 1, (8, 8)).round(5)
ENCODINGS = ["utf-16", "utf-16-le", "utf-16-be", "utf-8", "utf-8-sig", "latin-1", "utf-16-be-bom"]


def encoded(text, encoding):
    return ("\ufeff" + text).encode("utf-16-be") if encoding == "utf-16-be-bom" else text.encode(encoding)


def rows(values, between="\t"):
    return [
        between + between.join(f"{value:.6E}".replace("E-0", "E-00").replace("E+0", "E+00") for value in row)
        for row in values
    ]


def psf_text(head=HEAD, values=GRID, between="\t", end="\r\n"):
    return end.join([*head, *rows(values, between)]) + end


def without(*words):
    return [line for line in HEAD if not any(word in line for word in words)]


def write(path, text, encoding="utf-16"):
    path.write_bytes(encoded(text, encoding))
    return path


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("comma", [False, True])
def test_psf_in_every_encoding(tmp_path, encoding, comma):
    text = psf_text()
    if comma:
        text = text.replace(".", ",").replace("flash_MTF,zmx", "flash_MTF.zmx")
    psf = read_huygens_psf(write(tmp_path / "psf.txt", text, encoding))
    assert psf.values.dtype == np.float64 and psf.values.sum() == pytest.approx(1, abs=1e-12)
    assert np.allclose(psf.values, GRID / GRID.sum(), rtol=1e-6)  # six digits are written; the top row comes first
    assert psf.spacing_m == pytest.approx(2.5e-6, rel=1e-12)
    assert psf.center == (4, 3)  # row 5, column 4, counted from 0
    assert psf.field_deg == pytest.approx(1.25)
    assert psf.wavelength_m == pytest.approx((1.06e-6, 1.068e-6))
    assert psf.strehl == pytest.approx(0.913)


@pytest.mark.parametrize(
    ("old", "new", "field_deg", "wavelength_m"),
    [
        ("1.0600 to 1.0680 µm at 0.0000, 1.2500 (deg).", "1.0640 um at 1.2500 (deg).", 1.25, (1.064e-6, 1.064e-6)),
        ("1.0600 to 1.0680 µm at 0.0000, 1.2500 (deg).", "1064.0 nm at 3.0, -4.0 (deg).", 5.0, (1.064e-6, 1.064e-6)),
        ("1.0600 to 1.0680 µm at 0.0000, 1.2500 (deg).", "1.0640 μm at 0.0000, 6.4000 mm.", None, (1.064e-6,) * 2),
        ("1.0600 to 1.0680 µm at 0.0000, 1.2500 (deg).", "", None, None),
    ],
)
def test_field_and_wavelength_lines(tmp_path, old, new, field_deg, wavelength_m):
    psf = read_huygens_psf(write(tmp_path / "psf.txt", psf_text().replace(old, new)))
    assert psf.field_deg == (None if field_deg is None else pytest.approx(field_deg))
    assert psf.wavelength_m == (None if wavelength_m is None else pytest.approx(wavelength_m))


@pytest.mark.parametrize(
    ("head", "center"),
    [
        (without("Strehl", "Pupil", "Center", "Centroid", "Values"), (4, 4)),  # the middle is point n/2 + 1
        (without("Data area", "Image grid", "File", "Title"), (4, 3)),
        (without("Data spacing"), (4, 3)),  # 20 um over 8 points
        ([line.replace("is: 5, 4", "is: row 5, column 4") for line in HEAD], (4, 3)),
        ([line.replace("spacing is 2.500 µm", "spacing is 0.0025 mm") for line in HEAD], (4, 3)),
        ([line.replace("Listing of Huygens PSF Data", "HUYGENS PSF") for line in HEAD], (4, 3)),
        (["Data spacing is 2.500 ?m."], (4, 4)),
    ],
)
def test_header_variants(tmp_path, head, center):
    psf = read_huygens_psf(write(tmp_path / "psf.txt", psf_text(head)))
    assert psf.spacing_m == pytest.approx(2.5e-6, rel=1e-12)
    assert psf.center == center
    assert psf.values.shape == (8, 8)


def test_blank_lines_and_spaces(tmp_path):
    text = "\n\n".join([*HEAD, *rows(GRID, "   ")])
    psf = read_huygens_psf(write(tmp_path / "psf.txt", text, "latin-1"))
    assert np.allclose(psf.values, GRID / GRID.sum(), rtol=1e-6)


def with_value(value):
    spoilt = rows(GRID)
    spoilt[3] = "\t".join([value, *spoilt[3].split()[1:]])
    return "\n".join([*HEAD, *spoilt])


BROKEN = {
    "empty": ("", "is empty"),
    "blank": ("\n \n", "is empty"),
    "header alone": ("\n".join(HEAD), "no rows of numbers"),
    "rows missing": (psf_text(values=GRID[:5]), "5 rows of 8, but its header states 8 by 8"),
    "rows missing, size unsaid": (psf_text(without("Image grid"), GRID[:5]), "is square"),
    "last row short": (psf_text()[:-40], "line 29: has"),
    "ragged": ("\n".join([*HEAD, *rows(GRID)[:3], "1 2 3", *rows(GRID)[4:]]), "line 25: has 3 numbers"),
    "all zero": (psf_text(values=0 * GRID), "all its values are zero"),
    "negative": (with_value("-1.0E-001"), "line 25: contains a negative intensity"),
    "decibel": (psf_text(values=-10 * GRID), "negative intensity"),
    "nan": (with_value("NaN"), "not finite"),
    "windows nan": (with_value("-1.#IND"), "not finite"),
    "infinite": (with_value("1.#INF"), "not finite"),
    "a word": (with_value("vignetted"), "line 25: is not a row of numbers"),
    "no spacing": (psf_text(without("Data")), "Data spacing"),
    "zero spacing": (psf_text().replace("is 2.500", "is 0.000"), "data spacing is 0 m"),
    "center outside": (psf_text().replace("5, 4", "50, 4"), "center point is outside"),
    "another listing": (psf_text().replace("Huygens PSF Data", "Spot Diagram Data"), "a listing of Spot Diagram"),
    "cross section": (psf_text().replace("PSF Data", "PSF Cross Section Data"), "Cross Section"),
    "prose": ("Call me Ishmael.\nSome years ago\n", "is not a Huygens PSF listing"),
    "numbers alone": ("1 2\n3 4\n", "Data spacing"),
}


@pytest.mark.parametrize("case", BROKEN)
@pytest.mark.parametrize("encoding", ["utf-16", "latin-1"])
def test_broken_psf(tmp_path, case, encoding):
    text, told = BROKEN[case]
    path = write(tmp_path / "psf.txt", text, encoding)
    refused(read_huygens_psf, path, told)


def refused(reader, path, told):
    with pytest.raises(ScenarioError) as caught:
        reader(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and told in message and "\n" not in message
    assert message.count(": ") + message.count("; ") >= 2  # where: what: what to do


def test_broken_bytes(tmp_path):
    path = tmp_path / "psf.txt"
    for content, told in [
        (bytes(range(256)) * 20, "is not text"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256)), "is not text"),
        (psf_text().encode("utf-16")[:-3], "is cut off"),
        (psf_text().encode("utf-32"), "is not text"),
    ]:
        path.write_bytes(content)
        refused(read_huygens_psf, path, told)
    refused(read_huygens_psf, tmp_path / "none.txt", "no such file")
    refused(read_huygens_psf, tmp_path, "is a folder")
    with pytest.raises(ScenarioError, match="contains a NUL character"):
        read_huygens_psf("a\0b")


# The listing of the mascado documentation (Riechert 2018), shortened to 3 x 3 points.
FIELD, LENGTH = 7.5e-3, 6.84e5


def grid_text(n=1, skip=(), comma=False):
    lines = [
        "Listing of Grid Distortion Data",
        "",
        "File : C:\\lenses\\elt.zmx",
        "Title: optical system",
        "",
        "Units are Millimeters.",
        "Field units are degrees",
        "Wavelength: 1.00000 µm",
        "Reference Coordinates: Xref = 0.00000E+000, Yref = 0.00000E+000",
        "",
        "   i    j       X-Field       Y-Field       R-Field   Predicted X   Predicted Y"
        "        Real X        Real Y     Distortion",
    ]
    for j in range(-n, n + 1):
        for i in range(-n, n + 1):
            x, y = FIELD * i / n, FIELD * j / n
            px, py = (LENGTH * math.tan(math.radians(v)) for v in (x, y))
            numbers = [x, y, math.hypot(x, y), px, py, px * 0.99998, py * 0.99998]
            texts = [f"{value:.5E}" for value in numbers] if (i, j) not in skip else ["Ray", "failed"]
            lines.append(
                f"  {i:3d}  {j:3d} " + " ".join(texts) + ("     -0.002150%" if (i, j) == (n, n) else "     -0.00")
            )
    lines += [
        "",
        "Maximum distortion: -0.0021%",
        "Predicted coordinate ABCD matrix:",
        "A =    6.84e+005",
        "B =            0",
    ]
    lines += ["C =            0", "D =    6.84e+005", "", "SMIA TV Distortion -0.0011%", ""]
    text = "\r\n".join(lines)
    return text.replace(".", ",").replace("Millimeters,", "Millimeters.") if comma else text


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("comma", [False, True])
def test_grid_in_every_encoding(tmp_path, encoding, comma):
    grid = read_grid_distortion(write(tmp_path / "grid.txt", grid_text(comma=comma), encoding))
    assert grid.field_tangent.shape == grid.predicted_m.shape == grid.real_m.shape == (9, 2)
    assert grid.wavelength_m == pytest.approx(1e-6)
    assert grid.field_tangent[0] == pytest.approx([-math.tan(math.radians(FIELD))] * 2)
    # 89.5381 mm in the listing.
    assert grid.predicted_m[8] == pytest.approx([89.5381e-3] * 2, rel=1e-4)
    assert grid.real_m[8] == pytest.approx([89.5362e-3] * 2, rel=1e-4)
    assert np.all(grid.predicted_m[4] == 0)


def test_grid_units_and_lost_rays(tmp_path):
    text = grid_text(2).replace("Millimeters", "Inches")
    grid = read_grid_distortion(write(tmp_path / "grid.txt", text))
    assert grid.real_m[-1, 0] == pytest.approx(25.4 * 89.5362e-3, rel=1e-4)
    some = read_grid_distortion(write(tmp_path / "some.txt", grid_text(2, skip={(2, 2), (-2, 2)})))
    assert some.real_m.shape == (23, 2)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "is empty"),
        (psf_text(), "is not a Grid Distortion listing"),
        (grid_text().partition("Distortion\r\n")[0], "contains no points"),
        (grid_text(2)[:2600], "cut off"),
        (
            "\n".join(line for line in grid_text().splitlines() if not line.startswith("    1    1")),
            "8 points where its grid has 9",
        ),
        (grid_text().replace("Field units are degrees", "Field units are millimeters"), "not angles in degrees"),
        (grid_text().replace(f"{FIELD:.5E}", "NaN"), "not finite"),
        (grid_text().replace("-0.002150%", "1.0 2.0 3.0"), "columns"),
        (grid_text(1, skip={(0, 0)}), "8 points that the lens images"),
        (grid_text().replace(f"{FIELD:.5E}", "9.00000E+001"), "89 degrees"),
        (grid_text().replace(f"{FIELD:.5E}", "1.#IND"), "not finite"),
    ],
)
def test_broken_grids(tmp_path, text, told):
    path = write(tmp_path / "grid.txt", text, "latin-1")
    refused(read_grid_distortion, path, told)


def test_grid_that_is_binary(tmp_path):
    path = tmp_path / "grid.txt"
    path.write_bytes(bytes(range(1, 256)))
    refused(read_grid_distortion, path, "is not text")
