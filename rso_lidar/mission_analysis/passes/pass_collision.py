"""Probability of collision of the passes of a search, with everything that was used for it."""

from __future__ import annotations

import math
import numbers
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError, quote_value
from rso_lidar.mission_analysis.passes.covariance_sources import CovarianceSources
from rso_lidar.mission_analysis.passes.search_objects import BodyTrajectory, check_names, list_names
from rso_lidar.motion import Fixed
from rso_lidar.orbit import (
    CollisionEstimate,
    Epochs,
    NamedTrajectory,
    UncertainSeparation,
    UncertainState,
    check_radius,
    estimate_collision,
)
from rso_lidar.records import BodyState
from rso_lidar.rpo import rtn_matrix
from rso_lidar.scenario import Target, build_whole_surface

_WAVELENGTH_M = 1064.0 * units.NM  # of the materials of a mesh whose size alone counts
_NUMBER = re.compile(r"\s*[+-]?[0-9]+(\.[0-9]*)?([eE][+-]?[0-9]+)?\s*")
_LENGTH = re.compile(r"\s*([0-9.eE+-]+)\s*m\s*")


@dataclass(frozen=True)
class PassCollision:
    """Probability of collision of one pass, and what was used for it; NaN and empty where it is not known.

    `collision_probability` is that of `collision_method`, "Foster" or "3-D", which `collision_reason` explains. Where there
    is none, the reason states what would be needed. The other columns are those of `rl.orbit.CollisionEstimate`.
    `hard_body_radius_m` is the combined radius, and `hard_body_source` its origin. `covariance` and `follower_covariance`
    name the sources of the covariances. `miss_sigma_m` is the standard deviation of the relative position along the line of
    sight. `sigma_radial_m`, `sigma_along_m` and `sigma_cross_m` are those of the relative position in the rtn axes of the
    follower.
    """

    collision_probability: float = math.nan
    collision_method: str = ""
    collision_reason: str = ""
    foster_probability: float = math.nan
    integral_probability: float = math.nan
    integral_window_s: float = math.nan
    hard_body_radius_m: float = math.nan
    hard_body_source: str = ""
    follower_covariance: str = ""
    covariance: str = ""
    miss_sigma_m: float = math.nan
    sigma_radial_m: float = math.nan
    sigma_along_m: float = math.nan
    sigma_cross_m: float = math.nan
    mahalanobis: float = math.nan
    greatest_probability: float = math.nan
    greatest_scale: float = math.nan
    duration_share: float = math.nan
    is_diluted: bool = False
    differs: bool = False

    @property
    def is_known(self) -> bool:
        """Whether there is a probability."""
        return not math.isnan(self.collision_probability)

    @classmethod
    def columns(cls) -> list[str]:
        """Return the names of the columns of a table; those with a unit end in it."""
        return [entry.name for entry in fields(cls)]


class HardBodies:
    """Combined hard-body radii of pairs of objects.

    Parameters
    ----------
    entries : objects of the search
    radius_m : combined radius of all pairs, the sum of both objects' [m]; None: the sum of what is known of each
    bodies : radii of single objects by name or catalogue number: metres, text such as "2m", or a model of the catalogue,
        whose radius is that of a sphere about its centre of mass that holds its mesh. A target of a scenario needs none

    Raises
    ------
    ScenarioError
        For values that are no radius, and names that no object of the search has.
    MeshError
        For models that are not in the catalogue.
    """

    def __init__(
        self, entries: Sequence[Any], radius_m: float | None = None, bodies: Mapping[Any, Any] | None = None
    ) -> None:
        self.radius_m = None if radius_m is None else check_radius(radius_m)
        named = {} if bodies is None else dict(bodies)
        self._named = {str(name).strip().casefold(): _measure_body(str(name), body) for name, body in named.items()}
        check_names("hard_bodies", self._named, entries)
        self._meshes: dict[tuple[int, str], float] = {}

    @property
    def is_asked(self) -> bool:
        """Whether a radius was given."""
        return self.radius_m is not None or bool(self._named)

    def combine(self, first: Any, second: Any) -> tuple[float, str]:
        """Combine the radii of two objects.

        Parameters
        ----------
        first, second : element sets, several of one object, or `NamedTrajectory`

        Returns
        -------
        radius_m : combined radius [m]
        source : in a few words

        Raises
        ------
        ScenarioError
            If a radius is not known; the message states what would be needed.
        """
        if self.radius_m is not None:
            return self.radius_m, "as given"
        radii = [self._find(entry) for entry in (first, second)]
        check_radius(sum(radius_m for radius_m, _ in radii))
        return sum(radius_m for radius_m, _ in radii), " + ".join(source for _, source in radii)

    def _find(self, entry: Any) -> tuple[float, str]:
        single = entry[0] if isinstance(entry, list | tuple) else entry
        for key in list_names(single):
            if key in self._named:
                return self._named[key]
        body = getattr(single, "trajectory", None) if isinstance(single, NamedTrajectory) else None
        if isinstance(body, BodyTrajectory):
            for number, target in enumerate(body.scenario.target):
                if target.name == body.name:
                    key_of = id(body.scenario), body.name
                    if key_of not in self._meshes:
                        corners = body.scenario.corners_of(number)
                        self._meshes[key_of] = float(np.linalg.norm(corners, axis=1).max())
                    return self._meshes[key_of], f"mesh {target.shape} {self._meshes[key_of]:.3g} m"
        name = single.name or single.label
        raise ScenarioError(
            f"no hard-body radius of {name} is known; give the sum of both radii, or its radius or model"
        )


@dataclass(frozen=True)
class PassObject:
    """One object of a pass at the closest approach.

    Parameters
    ----------
    entry : an element set, several of one object, or a `NamedTrajectory`
    label : its name in messages
    age_days : age of its element set, NaN for a trajectory [day]
    state : (3,) in GCRS axes
    """

    entry: Any
    label: str
    age_days: float
    state: BodyState


def assess_pass(
    follower: PassObject, target: PassObject, epochs: Epochs, sources: CovarianceSources, bodies: HardBodies
) -> PassCollision:
    """Compute the probability of collision of a pass, or the reason why it is not known.

    Parameters
    ----------
    epochs : the one instant of the closest approach
    """
    try:
        radius_m, radius_source = bodies.combine(follower.entry, target.entry)
        own, own_source = _find_state(sources, follower, epochs)
        other, source = _find_state(sources, target, epochs)
        estimate = estimate_collision(own, other, radius_m)
    except (ScenarioError, PropagationError) as error:
        return PassCollision(collision_reason=str(error))
    between = UncertainSeparation.between(own, other)
    line = between.position_m / max(float(np.linalg.norm(between.position_m)), 1e-9)
    turn = rtn_matrix(own.position_m, own.velocity_m_s)[0]
    sigmas = np.sqrt(np.maximum(np.diag(turn.T @ between.covariance_m2 @ turn), 0.0))
    return PassCollision(
        **_list_probabilities(estimate),
        hard_body_radius_m=radius_m,
        hard_body_source=radius_source,
        follower_covariance=own_source,
        covariance=source,
        miss_sigma_m=math.sqrt(max(float(line @ between.covariance_m2 @ line), 0.0)),
        sigma_radial_m=float(sigmas[0]),
        sigma_along_m=float(sigmas[1]),
        sigma_cross_m=float(sigmas[2]),
    )


def _find_state(sources: CovarianceSources, body: PassObject, epochs: Epochs) -> tuple[UncertainState, str]:
    """Return the state of an object with its covariance, and where that comes from."""
    try:
        covariance, source = sources.find(body.entry, body.age_days, epochs, body.state)
        return UncertainState(body.state.position_m, body.state.velocity_m_s, covariance), source
    except (ScenarioError, PropagationError) as error:
        text = str(error)
        raise ScenarioError(text if body.label in text else f"{body.label}: {text}") from None


def _list_probabilities(estimate: CollisionEstimate) -> dict[str, Any]:
    """Return the columns that an estimate fills."""
    integral = estimate.integral
    return {
        "collision_probability": math.nan if estimate.probability is None else estimate.probability,
        "collision_method": estimate.method,
        "collision_reason": estimate.reason,
        "foster_probability": math.nan if estimate.foster is None else estimate.foster,
        "integral_probability": math.nan if integral is None else integral.probability,
        "integral_window_s": math.nan if integral is None else integral.window_s,
        "mahalanobis": estimate.mahalanobis,
        "greatest_probability": estimate.greatest,
        "greatest_scale": estimate.greatest_scale,
        "duration_share": estimate.duration_share,
        "is_diluted": estimate.is_diluted,
        "differs": estimate.differs,
    }


def _measure_body(name: str, body: Any) -> tuple[float, str]:
    """Return the radius [m] of one object from metres or a model, and where it comes from."""
    if isinstance(body, numbers.Real) and not isinstance(body, bool):
        return check_radius(float(body)), f"{float(body):g} m"
    if not isinstance(body, str) or not body.strip():
        raise ScenarioError(f"hard_bodies: {name}: {quote_value(body)} is no radius; give metres, or a model")
    match = _LENGTH.fullmatch(body)
    if match:
        try:
            return check_radius(float(match[1])), f"{float(match[1]):g} m"
        except ValueError:
            raise ScenarioError(f"hard_bodies: {name}: {body!r} is no length; write for example 2m") from None
    if _NUMBER.fullmatch(body):
        raise ScenarioError(f"hard_bodies: {name}: {body!r} has no unit; write {body.strip()}m, or a model")
    target = Target(name="body", model=body, motion=Fixed(position_m=(0.0, 0.0, 0.0)))
    if target.is_path:
        target = target.replace(center_of_mass_m=(0.0, 0.0, 0.0))
    radius_m = build_whole_surface(target, Path, _WAVELENGTH_M).radius_m
    return radius_m, f"model {Path(body).name} {radius_m:.3g} m"
