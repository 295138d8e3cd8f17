"""Sheets: closed, and as large as their outline says."""

import numpy as np
import pytest

from rso_lidar.shapes import Solid
from rso_lidar.shapes.torn_sheets import build_sheet


def test_a_sheet_holds_its_area_times_its_thickness():
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    assert build_sheet(square, 0.1, 3).volume_m3() == pytest.approx(0.4, rel=1e-12)
    assert isinstance(build_sheet(square, 0.1, 3), Solid)
