"""Assessment of a conjunction data message: geometry, probability of collision by three methods, what a scenario needs."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import ScenarioError
from rso_lidar.orbit import (
    CollisionEstimate,
    ConjunctionMessage,
    ConjunctionObject,
    IntegratedProbability,
    SampledProbability,
    UncertainSeparation,
    UncertainState,
    check_radius,
    describe_unlikely_units,
    estimate_collision,
    format_utc,
    sample_collisions,
)
from rso_lidar.rpo import rtn_matrix

_DIFFERENT = 0.01  # share by which a figure of the message may differ from its states, beside rounding
_ROUNDED_M, _ROUNDED_M_S = 1.0, 1.0  # messages state whole metres and metres per second
_LATE_S = 1e-2  # time between the message's instant and the closest approach of its states that is worth a note
_CURVED_S = 60.0  # length of an encounter beyond which straight lines are worth a note


@dataclass(frozen=True, eq=False)
class ConjunctionAssessment:
    """Geometry and probability of collision of a conjunction.

    `miss_m`, `speed_m_s` and `position_rtn_m` (3) are those of the message's states; the position is that of the second
    object in the rtn axes of the first. `miss_sigma_m` is the standard deviation of the position along the miss vector.
    `radius_m` is the combined hard-body radius, and `radius_source` its origin; without one there is no probability.
    `collision` is the probability by both methods and the choice between them, None without a radius. `notes` state what
    differs or is missing.
    """

    message: ConjunctionMessage
    first: UncertainState
    second: UncertainState
    miss_m: float
    speed_m_s: float
    position_rtn_m: np.ndarray
    miss_sigma_m: float
    radius_m: float | None
    radius_source: str
    collision: CollisionEstimate | None
    monte_carlo: SampledProbability | None
    notes: tuple[str, ...]

    @property
    def foster(self) -> float | None:
        """Probability by Foster; None without a radius, and where there is no encounter plane."""
        return None if self.collision is None else self.collision.foster

    @property
    def integral(self) -> IntegratedProbability | None:
        """Probability in 3-D; None without a radius, and where the relative position is known far better than it."""
        return None if self.collision is None else self.collision.integral

    def text(self) -> str:
        """Return the assessment as lines of text."""
        message, place = self.message, np.round(self.position_rtn_m, 1) + 0.0  # no -0.0
        lines = [
            f"{message.first.label} and {message.second.label}, closest approach {format_utc(message.tca_utc, 0.0)}",
            f"miss distance    {self.miss_m:,.1f} m, standard deviation along it {self.miss_sigma_m:,.1f} m"
            + _state(message.stated_miss_m, ",.6g", " m"),
            f"  radial {place[0]:,.1f}, along-track {place[1]:,.1f}, cross-track {place[2]:,.1f} m, in the rtn axes of "
            f"{message.first.name or 'OBJECT1'}",
            f"relative speed   {self.speed_m_s:,.2f} m/s" + _state(message.stated_speed_m_s, ",.6g", " m/s"),
        ]
        if self.radius_m is None:
            lines.append("no probability: no hard-body radius is given; state the sum of both radii")
        else:
            lines.append(f"hard-body radius {self.radius_m:g} m ({self.radius_source})")
            method = f", {message.stated_method}" if message.stated_method else ""
            without = "none: no relative velocity" if not self.speed_m_s > 0.0 else "none: singular covariance"
            known = without if self.foster is None else f"{self.foster:.4g}"
            lines.append(f"Pc by Foster     {known}" + _state(message.stated_probability, ".4g", method))
        if self.integral is not None:
            lines.append(
                f"Pc in 3-D        {self.integral.probability:.4g}, by the integral of Coppola and Hall within "
                f"{self.integral.window_s:,.3g} s of the closest approach"
            )
        if self.collision is not None:
            lines += _describe_choice(self.collision)
        if self.monte_carlo is not None:
            estimate = self.monte_carlo
            lines.append(
                f"Pc, Monte Carlo  {estimate.probability:.4g}, standard error {estimate.standard_error:.2g}, 95 % from "
                f"{estimate.low:.3g} to {estimate.high:.3g} ({estimate.hits:,} of {estimate.samples:,} draws, within "
                f"{estimate.window_s:,.3g} s of the closest approach)"
            )
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])


def assess_conjunction(
    message: ConjunctionMessage | str | Path,
    radius_m: float | None = None,
    *,
    samples: int | None = None,
    seed: int = 0,
    window_s: float | None = None,
) -> ConjunctionAssessment:
    """Compute miss distance, relative speed and probability of collision of a conjunction data message (CDM).

    Without a radius, that of the message counts: its HBR, else the sum of the radii of discs of both AREA_PC.

    Parameters
    ----------
    message : the message, or the path of its file
    radius_m : combined hard-body radius, the sum of both objects' (None: the message's) [m]

    Other Parameters
    ----------------
    samples : number of Monte Carlo draws (None: for some 1000 hits, from 1e5 to 4e6; 0: no Monte Carlo)
    seed : of the draws
    window_s : time that Monte Carlo and the integral search on each side of the closest approach (None: as in
        `rl.orbit.sample_collisions`, at most half a revolution) [s]

    Returns
    -------
    ConjunctionAssessment

    Raises
    ------
    ScenarioError
        For a file that is not a CDM; a radius, window or number of draws without meaning; covariances of no
        distribution.
    """
    if not isinstance(message, ConjunctionMessage):
        message = ConjunctionMessage.from_file(message)
    if isinstance(seed, bool) or not isinstance(seed, numbers.Integral) or seed < 0:
        raise ScenarioError(f"seed: {seed!r:.40} is not a seed; give a whole number, 0 or more")
    notes: list[str] = []
    first, second = (_make_state(message, body, notes) for body in (message.first, message.second))
    between = UncertainSeparation.between(first, second)
    miss_m = float(np.linalg.norm(between.position_m))
    rtn = rtn_matrix(first.position_m, first.velocity_m_s)[0]
    line = between.position_m / miss_m if miss_m > 0.0 else np.zeros(3)
    place = rtn.T @ between.position_m
    notes += _compare(message, miss_m, between.speed_m_s, place)
    if abs(between.closest_s) > _LATE_S:
        notes.append(
            f"the states are closest {between.closest_s:+.3g} s from the message's time, on straight lines; Foster's "
            "probability holds there"
        )
    for body, state in ((message.first, first), (message.second, second)):
        slip = describe_unlikely_units(state.covariance, "m", "larger")
        if slip:
            notes.append(f"{body.label}: {slip}")
    radius, source = _choose_radius(message, radius_m)
    collision, drawn = None, None
    if radius is not None:
        collision = estimate_collision(first, second, radius, window_s=window_s, always_integrate=True)
        if collision.missing:
            notes.append(f"no Pc in 3-D: {collision.missing}")
        if samples is None or samples != 0:
            rng = np.random.default_rng(int(seed))
            drawn = sample_collisions(first, second, radius, rng=rng, samples=samples, window_s=window_s)
            if drawn.window_s > _CURVED_S:
                notes.append(
                    f"Monte Carlo searches minutes ({drawn.window_s:,.0f} s on each side), in which relative motion is not "
                    "straight. Foster assumes that it is; Monte Carlo flies two-body orbits. It counts every closest "
                    "approach in its window, also a second one; set the window for one alone"
                )
    return ConjunctionAssessment(
        message=message,
        first=first,
        second=second,
        miss_m=miss_m,
        speed_m_s=between.speed_m_s,
        position_rtn_m=place,
        miss_sigma_m=math.sqrt(max(float(line @ between.covariance_m2 @ line), 0.0)),
        radius_m=radius,
        radius_source=source,
        collision=collision,
        monte_carlo=drawn,
        notes=tuple(notes),
    )


def _describe_choice(collision: CollisionEstimate) -> list[str]:
    """Describe which probability to take, and how far the mean is from a collision."""
    lines = []
    if collision.method:
        lines.append(f"Pc to take       {collision.probability:.4g}, by {collision.method}: {collision.reason}")
    if not math.isnan(collision.mahalanobis):
        line = f"Mahalanobis      {collision.mahalanobis:.3g} in the encounter plane"
        if collision.is_diluted:
            scale = f"{collision.greatest_scale:.3g} of the standard deviations"
            line += f"; diluted: at most {collision.greatest:.3g}, with {scale}"
        lines.append(line)
    return lines


def _state(value: float | None, form: str, unit: str) -> str:
    """Return what the message states of a figure, in parentheses; nothing for None."""
    return "" if value is None else f" (message: {value:{form}}{unit})"


def _make_state(message: ConjunctionMessage, body: ConjunctionObject, notes: list[str]) -> UncertainState:
    """Turn the state of an object to inertial axes, with its covariance."""
    covariance = body.covariance
    if not body.has_velocity_covariance:
        notes.append(f"{body.label}: the message gives no covariance of velocity, which counts as known")
        covariance = covariance[:3, :3]
    try:
        return UncertainState(body.position_m, body.velocity_m_s, covariance)
    except ScenarioError as error:
        try:
            state = UncertainState(body.position_m, body.velocity_m_s, covariance[:3, :3])
        except ScenarioError:
            raise ScenarioError(f"{message.where}: {body.label}: {error}") from None
        notes.append(
            f"{body.label}: its 6 x 6 covariance is not positive semidefinite; only the part of the position is used"
        )
        return state


def _choose_radius(message: ConjunctionMessage, radius_m: float | None) -> tuple[float | None, str]:
    """Return the combined hard-body radius [m], or None, and where it comes from."""
    if radius_m is not None:
        return check_radius(radius_m), "as given"
    if message.stated_radius_m is not None:
        return message.stated_radius_m, "HBR of the message"
    areas = message.first.area_m2, message.second.area_m2
    if areas[0] and areas[1]:
        return sum(math.sqrt(area / math.pi) for area in areas if area), "discs of both AREA_PC of the message"
    return None, ""


def _compare(message: ConjunctionMessage, miss_m: float, speed_m_s: float, place_m: np.ndarray) -> list[str]:
    """Compare the figures of a message with those of its states, and return a note for each that differs."""
    stated: list[tuple[str, Any, Any, float, str]] = [
        ("MISS_DISTANCE", message.stated_miss_m, miss_m, _ROUNDED_M, "m"),
        ("RELATIVE_SPEED", message.stated_speed_m_s, speed_m_s, _ROUNDED_M_S, "m/s"),
    ]
    notes = [
        f"{name} of the message is {value:,.6g} {unit}, but its states give {state_value:,.6g} {unit}"
        for name, value, state_value, rounded, unit in stated
        if value is not None and abs(value - state_value) > rounded + _DIFFERENT * state_value
    ]
    position_m = message.stated_position_m
    if position_m is not None:
        off_m = float(np.linalg.norm(position_m - place_m))
        if off_m > _ROUNDED_M + _DIFFERENT * miss_m:
            notes.append(f"RELATIVE_POSITION of the message is {off_m:,.6g} m from that of its states in rtn axes")
    return notes
