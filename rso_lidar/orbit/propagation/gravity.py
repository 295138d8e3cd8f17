"""The Earth's gravity from a file of coefficients in the format of ICGEM (.gfc), turning with the Earth."""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import Field, Strict, model_validator

from rso_lidar import files
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.propagation.harmonics import Harmonics
from rso_lidar.part import Part, Text
from rso_lidar.shipped import find

_SHIPPED, _SHIPPED_DEGREE = "gravity/egm2008_20x20.gfc", 20
_MOST_DEGREE = 120
_C20, _C20_SPREAD = -4.8417e-4, 1e-6  # fully normalised; models and tide systems differ by 1e-8
_HINT = "give a static gravity field of ICGEM with fully normalised coefficients"


class Gravity(Part):
    """Gravity of the Earth by spherical harmonics in Earth-fixed axes, to a degree and order."""

    degree: Annotated[int, Strict(), Field(ge=2, le=_MOST_DEGREE)] = Field(
        default=_SHIPPED_DEGREE, description="Highest degree; the shipped EGM2008 has 20."
    )
    order: Annotated[int, Strict(), Field(ge=0, le=_MOST_DEGREE)] | None = Field(
        default=None, description="Highest order, 0 for zonal harmonics only. If omitted, that of the degree."
    )
    file: Text | None = Field(
        default=None,
        description=(
            "Path of a static gravity field (.gfc) of ICGEM, whose GM and radius are used too. If omitted, EGM2008 to "
            "20 x 20, tide free."
        ),
    )
    earth_orientation_file: Text | None = Field(
        default=None,
        description=(
            "Path of the IERS file finals2000A.all, with polar motion and UT1. If omitted, UT1 is skyfield's and polar "
            "motion is left out, which moves a low orbit by metres in a day."
        ),
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.order is not None and self.order > self.degree:
            raise ValueError(f"order: {self.order} is above the degree {self.degree}; give at most {self.degree}")
        if self.file is None and self.degree > _SHIPPED_DEGREE:
            raise ValueError(
                f"degree: the shipped EGM2008 has {_SHIPPED_DEGREE}, not {self.degree}; give a file (.gfc) of ICGEM"
            )
        return self

    def load_harmonics(self) -> Harmonics:
        """Read the coefficients, cached until the file changes.

        Raises
        ------
        ScenarioError
            if the file is missing, is no such field, or has a lower degree
        """
        path = self.file or _SHIPPED
        place = find(path)
        if place is None:
            raise ScenarioError(f"gravity: {path}: no such file; give the path of a gravity field (.gfc) of ICGEM")
        status = place.stat()
        return _read(place, self.degree, self.order, status.st_mtime_ns, status.st_size)

    def load_orientation(self) -> EarthOrientation | None:
        """Read polar motion and UT1; None where no file is given."""
        path = self.earth_orientation_file
        return None if path is None else EarthOrientation.from_file(path)

    def describe(self) -> str:
        """Describe the field in a few words, such as "EGM2008 20 x 20"."""
        name = "EGM2008" if self.file is None else Path(self.file).stem
        return f"{name} {self.degree} x {self.degree if self.order is None else self.order}"


@functools.lru_cache(maxsize=8)
def _read(path: Path, degree: int, order: int | None, _modified_ns: int, _size: int) -> Harmonics:
    """Read a gravity field up to a degree and order."""
    where = f"gravity: {path}"
    lines = iter(files.read_text(path, files.MOST_BYTES, ScenarioError, "gravity field").splitlines())
    head: dict[str, str] = {}
    for line in lines:
        key, _, value = line.strip().partition(" ")
        if key == "end_of_head":
            break
        head.setdefault(key, value.strip())
    else:
        raise ScenarioError(f"{where}: has no line end_of_head; {_HINT}")
    if (norm := head.get("norm", "fully_normalized")) != "fully_normalized":
        raise ScenarioError(f"{where}: norm is '{norm:.30}'; {_HINT}")
    gm, radius_m = (_parse(head.get(key, ""), f"{where}: {key}") for key in ("earth_gravity_constant", "radius"))
    if not (3.9e14 < gm < 4.1e14 and 6.3e6 < radius_m < 6.4e6):
        raise ScenarioError(f"{where}: its constants {gm:g} m3/s2 and {radius_m:g} m are not the Earth's; {_HINT}")
    cosine, sine = np.full((degree + 1, degree + 1), math.nan), np.zeros((degree + 1, degree + 1))
    most = degree if order is None else order
    for line in lines:
        key, *words = line.split() or [""]
        if key in ("gfct", "trnd", "acos", "asin"):
            raise ScenarioError(f"{where}: its coefficients change with time ('{key}'); {_HINT}")
        if key != "gfc" or len(words) < 4:
            continue
        n, m, c, s = (_parse(word, f"{where}: '{line.strip():.60}'") for word in words[:4])
        if not (n == int(n) and m == int(m) and 0 <= m <= n and abs(c) <= 1.0 and abs(s) <= 1.0):
            raise ScenarioError(f"{where}: '{line.strip():.60}' is no coefficient; {_HINT}")
        if n <= degree and n > 0 and not math.isnan(cosine[int(n), int(m)]):
            raise ScenarioError(f"{where}: '{line.strip():.60}' is given twice; {_HINT}")
        if n <= degree:
            cosine[int(n), int(m)], sine[int(n), int(m)] = c, s
    needed = np.tril(np.ones_like(cosine, dtype=bool))
    needed[:2] = False
    missing = np.argwhere(needed & np.isnan(cosine))
    if len(missing):
        n, m = missing[0]
        raise ScenarioError(
            f"{where}: has no coefficient of degree {n} and order {m}; lower the degree, or give another"
        )
    if abs(cosine[2, 0] - _C20) > _C20_SPREAD:
        raise ScenarioError(f"{where}: degree 2 and order 0: {cosine[2, 0]:g} is not the Earth's {_C20:g}; {_HINT}")
    kept = needed & (np.arange(degree + 1) <= most)
    return Harmonics(gm, radius_m, np.where(kept, cosine, 0.0), np.where(kept, sine, 0.0))


def _parse(word: str, where: str) -> float:
    """Parse a number, whose exponent may be Fortran's."""
    try:
        value = float(word.replace("d", "e").replace("D", "e"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ScenarioError(f"{where}: '{word:.30}' is not a number; {_HINT}")
    return value
