"""Units of an FMU's variables, checked against those of the package and converted."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rso_lidar import units
from rso_lidar.errors import ScenarioError


class Conversion(NamedTuple):
    """A linear conversion: value in SI = factor x value of the FMU + offset."""

    factor: float
    offset: float = 0.0


# Exponents of kg, m, s, A, K, mol, cd, rad (FMI 3.0, sec. 2.4.4), and the factor to SI.
_KNOWN: dict[str, tuple[tuple[int, ...], float]] = {
    "1": ((0, 0, 0, 0, 0, 0, 0, 0), 1.0),
    "s": ((0, 0, 1, 0, 0, 0, 0, 0), 1.0),
    "ms": ((0, 0, 1, 0, 0, 0, 0, 0), 1e-3),
    "m": ((0, 1, 0, 0, 0, 0, 0, 0), 1.0),
    "mm": ((0, 1, 0, 0, 0, 0, 0, 0), 1e-3),
    "km": ((0, 1, 0, 0, 0, 0, 0, 0), 1e3),
    "m/s": ((0, 1, -1, 0, 0, 0, 0, 0), 1.0),
    "km/s": ((0, 1, -1, 0, 0, 0, 0, 0), 1e3),
    "m/s2": ((0, 1, -2, 0, 0, 0, 0, 0), 1.0),
    "mm/s2": ((0, 1, -2, 0, 0, 0, 0, 0), 1e-3),
    "N": ((1, 1, -2, 0, 0, 0, 0, 0), 1.0),
    "mN": ((1, 1, -2, 0, 0, 0, 0, 0), 1e-3),
    "kN": ((1, 1, -2, 0, 0, 0, 0, 0), 1e3),
    "N.m": ((1, 2, -2, 0, 0, 0, 0, 0), 1.0),
    "mN.m": ((1, 2, -2, 0, 0, 0, 0, 0), 1e-3),
    "rad": ((0, 0, 0, 0, 0, 0, 0, 1), 1.0),
    "deg": ((0, 0, 0, 0, 0, 0, 0, 1), units.DEG),
    "rad/s": ((0, 0, -1, 0, 0, 0, 0, 1), 1.0),
    "deg/s": ((0, 0, -1, 0, 0, 0, 0, 1), units.DEG),
    "rev/min": ((0, 0, -1, 0, 0, 0, 0, 1), 2.0 * math.pi / 60.0),
}


def find_conversion(
    where: str, declared: str | None, stated: str | None, definitions: dict[str, Any], wanted: str
) -> Conversion:
    """Find the conversion of a variable of an FMU to SI.

    Parameters
    ----------
    where : the FMU and the variable, for messages
    declared : unit that the FMU declares; None if it declares none
    stated : unit that the user states; None if none
    definitions : exponents, factor and offset of the FMU's units by name; None for a name without them
    wanted : unit of the quantity in the package, an SI unit of this module

    Returns
    -------
    Conversion

    Raises
    ------
    ScenarioError
        If there is no unit, or one of another dimension, or the two contradict each other
    """
    if declared is not None and stated is not None and declared != stated:
        raise ScenarioError(
            f"{where}: has the unit '{declared}', and `units` states '{stated}'; leave out the statement"
        )
    name = declared if declared is not None else stated
    dimension, _ = _KNOWN[wanted]
    if name is None:
        if wanted == "1":
            return Conversion(1.0)
        raise ScenarioError(f'{where}: declares no unit; state it under `units`, such as "{wanted}"')
    defined = definitions.get(name) if declared is not None else None
    if defined is None:
        if name not in _KNOWN:
            raise ScenarioError(
                f"{where}: the unit '{name}' is not defined by the FMU and not known; use one of {', '.join(_KNOWN)}"
            )
        exponents, factor, offset = *_KNOWN[name], 0.0
    else:
        exponents, factor, offset = defined
    # Some tools give angles no dimension.
    if tuple(exponents) != dimension and tuple(exponents) != (*dimension[:-1], 0):
        raise ScenarioError(f"{where}: has the unit '{name}', which is not a unit of {wanted}; correct the mapping")
    return Conversion(float(factor), float(offset))
