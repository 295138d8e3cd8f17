"""Area-to-mass ratio of fragments of spacecraft by the NASA Standard Breakup Model, 1998 revision.

Source: Johnson, Krisko, Liou and Anz-Meador 2001, "NASA's new breakup model of EVOLVE 4.0", Adv. Space Res. 28(9), 1377.
Powers and logarithms are computed in decimal arithmetic, which has the same digits on every processor.
"""

from __future__ import annotations

import decimal

from rso_lidar.shapes.torn_sheets import UniformNumbers

_DIGITS = decimal.Context(prec=20)
_SMALL_M, _LARGE_M = 0.08, 0.11  # between these lengths the two distributions are bridged (Johnson et al., eq. 6 and 7)
_UNIFORMS = 12  # whose sum less 6 is a normal number to within its 4-sigma tails


def power_of_ten(exponent: float) -> float:
    """Return ten to a power."""
    return float(_DIGITS.power(decimal.Decimal(10), _DIGITS.create_decimal(exponent)))


def draw_area_to_mass(length_m: float, numbers: UniformNumbers) -> float:
    """Draw the area-to-mass ratio [m2/kg] of a fragment of a spacecraft.

    Its logarithm is normal below 8 cm and a mixture of two normal distributions above 11 cm. Between the two lengths one of
    both is chosen, with a probability that is linear in length.

    Parameters
    ----------
    length_m : characteristic length of the fragment [m]
    numbers : random numbers of the fragment
    """
    x = float(_DIGITS.log10(_DIGITS.create_decimal(length_m)))
    is_large = numbers.random() < (length_m - _SMALL_M) / (_LARGE_M - _SMALL_M)
    first, normal = numbers.random(), float(sum(numbers.random(_UNIFORMS).tolist())) - 0.5 * _UNIFORMS
    if not is_large:
        mean = _ramp(x, -1.75, -1.25, -0.3, -1.0)
        sigma = 0.2 + 0.1333 * max(0.0, x + 3.5)
    elif first < _ramp(x, -1.95, 0.55, 0.0, 1.0):
        mean, sigma = _ramp(x, -1.1, 0.0, -0.6, -0.95), _ramp(x, -1.3, -0.3, 0.1, 0.3)
    else:
        mean, sigma = _ramp(x, -0.7, -0.1, -1.2, -2.0), _ramp(x, -0.5, -0.3, 0.5, 0.3)
    return power_of_ten(mean + sigma * normal)


def _ramp(x: float, start: float, end: float, before: float, after: float) -> float:
    """Return a value that is constant before and after a linear part.

    Parameters
    ----------
    x : logarithm of the characteristic length in metres
    """
    return before + (after - before) * min(1.0, max(0.0, (x - start) / (end - start)))
