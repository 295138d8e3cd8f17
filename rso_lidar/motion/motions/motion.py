"""The protocol of motions, and all motions of a scenario as one annotated field."""

from __future__ import annotations

import datetime
from types import NoneType
from typing import Annotated, Any, Protocol, runtime_checkable

import numpy as np
from pydantic import Field

from rso_lidar.errors import ScenarioError
from rso_lidar.motion.motions.fmu_motion import FmuMotion
from rso_lidar.motion.motions.placement import PlacedMotion
from rso_lidar.motion.motions.prescribed_motion import Fixed, Table
from rso_lidar.motion.motions.state_space import StateSpace
from rso_lidar.orbit import (
    J2,
    Ephemeris,
    Epochs,
    Kepler,
    LunarKepler,
    LunarState,
    Numerical,
    Omm,
    Opm,
    SpiceMotion,
    State,
    Tle,
)
from rso_lidar.part import (
    Part,
    Seam,
    call_member,
    check_lines,
    check_text,
    kind_of,
    read_member,
)
from rso_lidar.records import BodyState
from rso_lidar.rpo import (
    Circumnavigation,
    CoElliptic,
    Flown,
    ForcedCircumnavigation,
    Glideslope,
    Hill,
    Hop,
    Lambert,
    Nonlinear,
    Perch,
    PulsedStationKeeping,
    RBarApproach,
    RelativeElements,
    Rendezvous,
    SafetyEllipse,
    Sequence,
    StationKeeping,
    Teardrop,
    VBarApproach,
    Waypoints,
    YamanakaAnkersen,
)

_PARALLEL = 1e-12  # squared sine below which position and velocity are taken as parallel


@runtime_checkable
class Motion(Protocol):
    """Protocol of user-defined motions; the single method `states` is enough.

    `states` may be called with any epochs from 2 s before the first frame to 2 s after the last. The reason is that rates
    of orbital axes are finite differences. The result at one epoch must not depend on the others, and the object must
    not change. An epoch without a state raises `PropagationError`. These optional members are recognised:

    - ``orbits``: False if the states are not an orbit about the Earth. The body then has no rtn axes, and its states are
      in root axes, also in a local world. The default is True.
    - ``breaks_s(epochs)``: instants [s since `start_utc`] at which the state has a jump or a corner, or begins or ends.
      No finite difference reaches across one.
    - ``validity(epochs)``: a sentence for each limit of the model that is exceeded; it becomes a warning.
    - ``summarize(start_utc)``: the motion in a few words, for the description of a scenario.

    `examples/seams/own_motion.py` is an example.
    """

    def states(self, epochs: Epochs) -> BodyState:
        """Compute position and velocity of the body's origin.

        Parameters
        ----------
        epochs : instants

        Returns
        -------
        position [m] and velocity [m/s], each (time, 3), in GCRS axes
        """


DescribedMotion = Annotated[
    Tle
    | Omm
    | Kepler
    | State
    | J2
    | Numerical
    | Ephemeris
    | Opm
    | SpiceMotion
    | LunarKepler
    | LunarState
    | Hill
    | YamanakaAnkersen
    | RelativeElements
    | Nonlinear
    | StationKeeping
    | PulsedStationKeeping
    | Perch
    | VBarApproach
    | RBarApproach
    | Glideslope
    | Hop
    | CoElliptic
    | Circumnavigation
    | SafetyEllipse
    | Teardrop
    | ForcedCircumnavigation
    | Waypoints
    | Rendezvous
    | Lambert
    | Sequence
    | Flown
    | StateSpace
    | FmuMotion
    | Fixed
    | Table,
    Field(discriminator="type"),
]
AnyMotion = Annotated[DescribedMotion | Motion, Seam(DescribedMotion, Motion)]


def has_orbit(motion: Any) -> bool:
    """Return whether a body with this motion has an orbit, and therefore rtn axes."""
    return bool(read_member(motion, "orbits", True, bool, "make it True or False, or a property"))


def get_chief_name(motion: Any) -> str | None:
    """Return the name of the body to which a motion is relative; None if it is relative to the root.

    Parameters
    ----------
    motion : any motion
    """
    name: str | None = read_member(motion, "relative_to", None, (str, NoneType), "name a body, or leave it out")
    return name


def is_attached(motion: Any) -> bool:
    """Return whether a motion is given in the body axes of another body, and not in its rtn axes."""
    return isinstance(motion, PlacedMotion) and motion.is_attached


def states_of(motion: Any, epochs: Epochs) -> BodyState:
    """Call a motion and check its result; raise `ScenarioError` if it is not a `BodyState` of these epochs."""
    state = motion.states(epochs)
    if isinstance(motion, Part):
        return state  # type: ignore[no-any-return]
    shape = (len(epochs), 3)
    if not isinstance(state, BodyState) or np.shape(state.position_m) != shape or np.shape(state.velocity_m_s) != shape:
        raise ScenarioError(
            f"{kind_of(motion)}: states() returned a {type(state).__name__} that is not a BodyState of {shape[0]} epochs; "
            f"return BodyState(position_m, velocity_m_s), each {shape}"
        )
    if not (np.isfinite(state.position_m).all() and np.isfinite(state.velocity_m_s).all()):
        raise ScenarioError(f"{kind_of(motion)}: states() returned numbers that are not finite; correct them")
    if has_orbit(motion):
        position, velocity = state.position_m, state.velocity_m_s
        squares = _row_products(position, position) * _row_products(velocity, velocity)
        if not (squares - _row_products(position, velocity) ** 2 > _PARALLEL * squares).all():
            raise ScenarioError(
                f"{kind_of(motion)}: states() returned a velocity that is zero or along the position, so that the orbit has "
                "no plane; correct it, or set orbits = False"
            )
    return state


def _row_products(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the scalar products (time) of vectors (time, 3)."""
    products: np.ndarray = np.einsum("ij,ij->i", a, b)
    return products


def list_exceeded_limits(motion: Any, *known: Any) -> list[str]:
    """List the limits of its model that a motion exceeds, one sentence each; by default none."""
    return check_lines(motion, "validity", call_member(motion, "validity", *known, default=[]))


def summarize_motion(motion: Any, start_utc: datetime.datetime) -> str:
    """Describe a motion in a few words, such as ``hill relative to tdrs``.

    Parameters
    ----------
    motion : any motion
    start_utc : start of the run

    Returns
    -------
    a few words
    """
    text = check_text(motion, "summarize", call_member(motion, "summarize", start_utc, default=kind_of(motion)))
    return text if get_chief_name(motion) is None else f"{text} relative to {get_chief_name(motion)}"


def advise_on_motion(part: Any, end_s: float) -> list[str]:
    """Report what in a motion or an attitude is probably a mistake.

    Parameters
    ----------
    part : the motion or attitude
    end_s : end of the run [s]

    Returns
    -------
    one line for each mistake
    """
    return check_lines(part, "advise", call_member(part, "advise", end_s, default=[]))
