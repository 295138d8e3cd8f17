"""Relative motion by quasi-nonsingular relative orbital elements, with J2.

D'Amico, Autonomous Formation Flying in Low Earth Orbit (2010), eq. 2.2, each multiplied by the chief's semi-major axis a.
With u the mean argument of latitude and (ex, ey) = e (cos, sin) of the argument of perigee, of the chief (c) and the body
(d):

    delta_a = ad - ac                            delta_ex = a (exd - exc)    delta_ix = a (id - ic)
    delta_lambda = a (ud - uc + dRAAN cos ic)    delta_ey = a (eyd - eyc)    delta_iy = a dRAAN sin ic

Rows of elements are those of `orbit.propagation.j2`, in axes whose z is the Earth's pole of date.
"""

from __future__ import annotations

import datetime
import functools
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import (
    Epochs,
    Trajectory,
    equator_axes,
    find_center,
    mean_from_osculating,
    osculating_from_mean,
    propagate_j2_secular,
    propagate_two_body,
    quasi_nonsingular_from_state,
    state_from_quasi_nonsingular,
    state_rates,
)
from rso_lidar.part import Flag, Number
from rso_lidar.pose import rotate_vectors
from rso_lidar.records import BodyState
from rso_lidar.rpo.relative.hill import describe_flattening, find_mean_motion_rad_s, find_start_state
from rso_lidar.rpo.relative.reference_orbit import find_relative_state
from rso_lidar.rpo.relative.relative_motion import RelativeMotion

_TURNED_RAD = 0.05
_IN_AIR_M = 500e3
_NAMES = ("delta_a_m", "delta_lambda_m", "delta_ex_m", "delta_ey_m", "delta_ix_m", "delta_iy_m")


class RelativeElements(RelativeMotion):
    """Motion by relative orbital elements at `start_utc`: mean elements with `j2`, osculating ones without.

    The chief's elements are those of its state at `start_utc`. With `j2` both orbits follow the secular rates of J2 and
    the first-order map to osculating states, and their difference is exact. Over a day it agrees with an integration
    with J2 alone within 1e-5 of the separation (2e-5 at an eccentricity of 0.7). Left out are J3 to J6, up to 1e-3 of
    the separation over a day in low orbit; Sun and Moon, 2e-4 in geostationary orbit; and drag. Without `j2` both are
    two-body orbits, and the error is up to 4.5 % of the separation per revolution in low orbit. The difference is taken
    in the rtn axes of the chief so propagated, and applied in its actual axes.
    """

    type: Literal["relative_elements"] = "relative_elements"
    delta_a_m: Number = Field(default=0.0, description="Difference of the semi-major axes [m].")
    delta_lambda_m: Number = Field(
        default=0.0,
        description=(
            "Difference of the mean arguments of latitude, plus that of the nodes times cos i. Like those below, it "
            "is scaled by the body's semi-major axis [m]."
        ),
    )
    delta_ex_m: Number = Field(default=0.0, description="Difference of e cos ω, scaled by the semi-major axis [m].")
    delta_ey_m: Number = Field(default=0.0, description="Difference of e sin ω, scaled by the semi-major axis [m].")
    delta_ix_m: Number = Field(
        default=0.0,
        description="Difference of the inclinations to the equator of date, scaled by the semi-major axis [m].",
    )
    delta_iy_m: Number = Field(
        default=0.0,
        description="Difference of the nodes' right ascensions times sin i, scaled by the semi-major axis [m].",
    )
    j2: Flag = Field(
        default=True,
        description=(
            "Whether the elements are mean ones with the secular rates of J2. If false, they are osculating ones of "
            "two-body motion."
        ),
    )

    @property
    def elements_m(self) -> np.ndarray:
        """Relative elements delta a, lambda, ex, ey, ix, iy (6,), each times the chief's semi-major axis [m]."""
        return np.array([getattr(self, name) for name in _NAMES])

    def relative(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] (time, 3) in the chief's rotating rtn axes."""
        self.check_center(find_center(chief))
        rows = self._rows(epochs, chief)
        if self.j2:
            of, body = (_MeanElementOrbit(row) for row in rows)
            there = of.states(epochs)
            rates = there.velocity_m_s, state_rates(of, epochs, there)[1]
            return find_relative_state(there, body.states(epochs), rates)
        there, here = (
            BodyState(*propagate_two_body(*state_from_quasi_nonsingular(row), epochs.time_s)) for row in rows
        )
        return find_relative_state(there, here)

    def _rows(self, epochs: Epochs, chief: Trajectory) -> tuple[np.ndarray, np.ndarray]:
        """Return the elements of the chief and of the body at `start_utc`, rows (6,)."""
        find_mean_motion_rad_s(chief, epochs.start_utc)  # raises an error if the orbit is open
        position, velocity = find_start_state(chief, epochs.start_utc)
        return _find_start_elements(self, epochs.start_utc, tuple(position.tolist()), tuple(velocity.tolist()))

    def validity(self, epochs: Epochs, chief: Trajectory) -> list[str]:
        """Return one sentence for each limit of the model that these epochs exceed, with a better choice."""
        of, body = self._rows(epochs, chief)
        sentences = []
        turned_rad = abs(body[5] - of[5])
        if turned_rad > _TURNED_RAD:
            sentences.append(
                f"relative_elements: the chief's inclination is {of[4] / units.DEG:.3g} deg, so delta_iy_m turns the node "
                f"by {turned_rad / units.DEG:.3g} deg and the elements no longer mean amplitudes; use nonlinear"
            )
        if not self.j2:
            return sentences + describe_flattening(
                "relative_elements",
                epochs,
                *find_start_state(chief, epochs.start_utc),
                better="set j2 = true, or use nonlinear with forces",
            )
        duration_s = float(np.abs(epochs.time_s).max(initial=0.0))
        low_m = of[0] * (1.0 - math.hypot(of[2], of[3])) - units.EARTH_RADIUS_M
        if low_m < _IN_AIR_M and duration_s > units.DAY_S:
            sentences.append(
                f"relative_elements: the chief comes down to {low_m / units.KM:.0f} km in {duration_s / units.DAY_S:.1f} "
                "days, where drag, which this model leaves out, moves bodies of unequal area and mass apart; use a motion "
                "of type numerical for each"
            )
        return sentences


@dataclass(frozen=True, eq=False)
class _MeanElementOrbit:
    """The trajectory of mean elements, a row (6) that holds at the start, in axes of the equator of that date."""

    row: np.ndarray

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3)."""
        return BodyState(*osculating_from_mean(propagate_j2_secular(self.row, epochs.time_s)))


@functools.lru_cache(maxsize=64)
def _find_start_elements(
    part: RelativeElements, start_utc: datetime.datetime, chief_m: tuple[float, ...], chief_m_s: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the elements (6,) of the chief and of the body at the start, cached.

    Parameters
    ----------
    chief_m, chief_m_s : (3,) state of the chief in GCRS axes [m], [m/s]

    Raises
    ------
    ScenarioError
        if an element is more than half the chief's orbit
    """
    state = rotate_to_equator(BodyState(np.array(chief_m), np.array(chief_m_s)), Epochs(start_utc, np.zeros(1)))
    of = (mean_from_osculating if part.j2 else quasi_nonsingular_from_state)(state.position_m, state.velocity_m_s)
    half_m = math.pi * float(of[0])
    for name, value in zip(_NAMES, part.elements_m.tolist(), strict=True):
        if abs(value) > half_m:
            raise ScenarioError(
                f"{name}: {value / units.KM:.4g} km is more than half the chief's orbit, {half_m / units.KM:.0f} km either "
                "way, beyond which angles repeat; make it smaller"
            )
    body = add_relative_elements(of, part.elements_m)
    if not (body[0] > 0.0 and body[0] * (1.0 - math.hypot(body[2], body[3])) > units.EARTH_RADIUS_M):
        raise ScenarioError(
            "delta_a_m, delta_ex_m, delta_ey_m: they put the body's perigee inside the Earth; make them smaller"
        )
    for row in (of, body):
        row.flags.writeable = False
    return of, body


def rotate_to_equator(state: BodyState, epochs: Epochs) -> BodyState:
    """Rotate states from GCRS axes to those of the equator of date; a single state takes one epoch."""
    turn = equator_axes(epochs)
    turn = turn[0] if state.position_m.ndim == 1 else turn
    return BodyState(rotate_vectors(turn, state.position_m), rotate_vectors(turn, state.velocity_m_s))


def difference_elements(chief: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Return the relative elements between rows of elements, each (…, 6): delta a, lambda, ex, ey, ix, iy [m]."""
    c, d = np.asarray(chief, dtype=float), np.asarray(body, dtype=float)
    a, node = c[..., 0], _wrap_angle(d[..., 5] - c[..., 5])
    parts = (
        d[..., 0] - a,
        a * _wrap_angle(d[..., 1] - c[..., 1] + node * np.cos(c[..., 4])),
        a * (d[..., 2] - c[..., 2]),
        a * (d[..., 3] - c[..., 3]),
        a * (d[..., 4] - c[..., 4]),
        a * node * np.sin(c[..., 4]),
    )
    return np.stack(parts, axis=-1)


def add_relative_elements(chief: np.ndarray, elements_m: np.ndarray) -> np.ndarray:
    """Return a body's row of elements from the chief's and relative ones; the inverse of `difference_elements`.

    Parameters
    ----------
    chief : (…, 6) row of elements
    elements_m : (…, 6) delta a, lambda, ex, ey, ix, iy [m]

    Raises
    ------
    ScenarioError
        if delta iy is not zero about an equatorial chief, which has no node to turn
    """
    c = np.asarray(chief, dtype=float)
    da, dl, dex, dey, dix, diy = np.moveaxis(np.asarray(elements_m, dtype=float) / c[..., :1], -1, 0)
    sine = np.sin(c[..., 4])
    if np.any((np.abs(diy) > np.abs(sine)) & (diy != 0.0)):
        raise ScenarioError(
            "delta_iy_m: the chief's orbit is too near the equator for it, whose node would turn by delta_iy / (a sin i); "
            "use motion 'nonlinear'"
        )
    node = diy / np.where(sine == 0.0, 1.0, sine)
    return np.stack(
        [
            c[..., 0] * (1.0 + da),
            c[..., 1] + dl - node * np.cos(c[..., 4]),
            c[..., 2] + dex,
            c[..., 3] + dey,
            c[..., 4] + dix,
            c[..., 5] + node,
        ],
        axis=-1,
    )


def relative_elements_from_states(chief: BodyState, body: BodyState) -> np.ndarray:
    """Return the osculating relative elements of states. Inclinations are to the plane normal to the z axis of the states.

    Parameters
    ----------
    chief, body : states (…, 3) in common inertial axes

    Returns
    -------
    (…, 6) delta a, lambda, ex, ey, ix, iy [m]
    """
    rows = [quasi_nonsingular_from_state(state.position_m, state.velocity_m_s) for state in (chief, body)]
    return difference_elements(*rows)


def state_from_relative_elements(chief: BodyState, elements_m: np.ndarray) -> BodyState:
    """Return a body's inertial state (…, 3) from the chief's and relative elements; the inverse of
    `relative_elements_from_states`.

    Parameters
    ----------
    chief : state (…, 3) in inertial axes
    elements_m : (…, 6) delta a, lambda, ex, ey, ix, iy [m]
    """
    return BodyState(
        *state_from_quasi_nonsingular(
            add_relative_elements(quasi_nonsingular_from_state(chief.position_m, chief.velocity_m_s), elements_m)
        )
    )


def _wrap_angle(angle: np.ndarray) -> np.ndarray:
    """Wrap an angle into [-pi, pi]."""
    turn: np.ndarray = angle - math.tau * np.round(angle / math.tau)
    return turn
