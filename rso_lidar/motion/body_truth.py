"""The truth of the bodies: the tree of axes (Fuller et al., sec. 3.1.1), vectorised over all epochs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import NoneType
from typing import Any

import numpy as np

from rso_lidar.errors import RsoLidarError, add_place, has_warnings_enabled, suppress_warnings, warn
from rso_lidar.motion.attitudes.attitude_hold import FixedAttitude
from rso_lidar.motion.attitudes.situation import Orientation, Situation, orient
from rso_lidar.motion.attitudes.sun_pointing import sun_line
from rso_lidar.motion.bodies.body import Body
from rso_lidar.motion.bodies.hinge import find_sun_in_body
from rso_lidar.motion.bodies.orbital_axes import find_turning_rad_s, link_orbit, list_breaks_s
from rso_lidar.motion.bodies.order import list_dependencies, sort_bodies
from rso_lidar.motion.dynamics.commands import CommandedFlight, CommandedModel
from rso_lidar.motion.motions.motion import get_chief_name, list_exceeded_limits, states_of
from rso_lidar.motion.motions.placement import Place, PlacedMotion
from rso_lidar.motion.sun_vectors import SunVectors
from rso_lidar.orbit import (
    CentralBody,
    Epochs,
    ForceModel,
    differentiate,
    find_center,
    find_center_states,
    subtract_center,
)
from rso_lidar.part import read_member
from rso_lidar.pose import ROOT, Link, PoseTree, cross, rotate_vectors
from rso_lidar.records import BodyState, Truth
from rso_lidar.rpo import RtnMotion, rtn_matrix

Flights = Mapping[str, CommandedFlight]
ROUNDING_RAD_S = 1e-15


def truth(
    bodies: Sequence[Body],
    epochs: Epochs,
    *,
    local: bool = False,
    sun_direction: Sequence[float] | np.ndarray | None = None,
    flights: Flights | None = None,
    rates: bool = True,
) -> Truth:
    """Compute poses, rates and states of all bodies at all epochs as one batch.

    Each body has two nodes. The first is its origin, in axes that do not turn with the body: ``tdrs.rtn`` for a body
    that orbits, ``plate.origin`` for any other. Its body axes are a child of that, and its hinges are children of the
    body axes. The origin of a relative motion is a child of the rtn axes of its chief, so that relative poses are
    composed without inertial coordinates.

    Parameters
    ----------
    bodies : all bodies
    epochs : instants
    local : whether the world is local, without an Earth
    sun_direction : direction to the Sun of a local world, of any length, in root axes; None for none
    flights : of commanded state-space models, by the names in `Command.inputs`; None for none
    rates : whether the rates of the axes are needed. If False, only poses and states are valid, which is faster

    Returns
    -------
    truth of all epochs; ``truth.at(k)`` is that of one
    """
    order, sun = tuple(sort_bodies(bodies, local=local)), SunVectors(epochs, local, sun_direction)
    here = _Evaluation(tuple(bodies), order, epochs, local, sun, flights or {}, rates)
    tree = here.evaluate()
    states = {body.name: here.states.get(body.name) or here.read_state(tree, body.origin) for body in bodies}
    lit: dict[str, np.ndarray] = {}
    if here.sun.position_m is not None:
        lit = {name: here.sun.visible_fraction(state, here.centers.get(name)) for name, state in states.items()}
    return Truth(epochs.time_s, tree, states, here.sun.direction, None, lit)


@dataclass(frozen=True, eq=False)
class _Evaluation:
    """Everything that the bodies of one evaluation share; `order` names the axes to evaluate, each after what it needs."""

    bodies: tuple[Body, ...]
    order: tuple[str, ...]
    epochs: Epochs
    local: bool
    sun: SunVectors
    flights: Flights
    rates: bool = True
    by_name: dict[str, Body] = field(default_factory=dict)
    chiefs: dict[str, Chief] = field(default_factory=dict)
    # Of bodies that orbit: their states, and the angular velocities (time, 3) [rad/s] of their rtn axes, in those axes.
    states: dict[str, BodyState] = field(default_factory=dict)
    turning: dict[str, np.ndarray] = field(default_factory=dict)
    # Of bodies that orbit: the states of the centre about which they do; None for the Earth, which is the origin.
    centers: dict[str, BodyState | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.by_name.update({body.name: body for body in self.bodies})

    def evaluate(self) -> PoseTree:
        """Evaluate all axes in one pass, and keep the states of bodies that orbit."""
        tree, by_origin = PoseTree({}, {}), {body.origin: body for body in self.bodies}
        for name in self.order:
            if (body := by_origin.get(name)) is not None:
                with add_place(f"{body.name}.motion"):
                    tree = self.add_origin(tree, body)
            else:
                body = self.by_name[name]
                with add_place(f"{name}.attitude"):
                    tree = self.add_body_axes(tree, body)
                with add_place(f"{name}.joint"):
                    tree = self.add_hinges(tree, body)
        return tree

    def move(self, bodies: Sequence[Body], names: Iterable[str], epochs: Epochs, *, rates: bool = True) -> _Evaluation:
        """Evaluate some axes of some bodies, with rates if needed, at other epochs, in the order that is known."""
        wanted, sun = frozenset(names), SunVectors(epochs, self.local, self.sun.given)
        order = tuple(name for name in self.order if name in wanted)
        return _Evaluation(tuple(bodies), order, epochs, self.local, sun, self.flights, rates)

    @cached_property
    def relative_turning(self) -> dict[str, np.ndarray]:
        """Angular velocities (time, 3) [rad/s] of the rtn axes of relative motions, relative to those of their chiefs.

        Each is the derivative of the rotation between them, in the body's own axes. A body whose chief is under command
        is left out, because the chief has no state after the epoch.
        """
        names = [body.name for body in self.bodies if self._can_differentiate(body)] if self.rates else []
        if not names:
            return {}
        some = [body.replace(attitude=None, axes=()) for body in self.bodies if body.orbits]
        origins = [self.by_name[name].origin for name in names]
        breaks_s = list_breaks_s(some, self.epochs, Chief)

        def rows(time_s: np.ndarray) -> np.ndarray:
            beside = Epochs(self.epochs.start_utc, time_s)
            poses = self.move(some, [body.origin for body in some], beside, rates=False).evaluate()
            matrices = [np.broadcast_to(poses[origin].matrix, (len(time_s), 3, 3)) for origin in origins]
            return np.concatenate([matrix.reshape(-1, 9) for matrix in matrices], axis=1)

        with suppress_warnings():
            try:
                here = rows(self.epochs.time_s)
                change = differentiate(rows, self.epochs.time_s, here, breaks_s)
            except RsoLidarError:  # no state beside an epoch; an error at an epoch itself is raised elsewhere
                return {}
        back, slope = here.reshape(-1, len(names), 3, 3), change.reshape(-1, len(names), 3, 3)
        spin = np.einsum("tnki,tnkj->ntij", back, slope)
        rates = np.stack([spin[..., 2, 1], spin[..., 0, 2], spin[..., 1, 0]], axis=-1)
        return dict(zip(names, rates, strict=True))

    def _can_differentiate(self, body: Body) -> bool:
        """Return whether a body moves relative to a chief, and no body in the chain of chiefs is under command."""
        if not isinstance(body.motion, RtnMotion):
            return False
        while (relative_to := get_chief_name(body.motion)) is not None:
            body = self.by_name[relative_to]
            if body.name in self.flights:
                return False
        return True

    def turns(self, body: Body) -> bool:
        """Return whether the rotation of a body's orbital plane is needed, for rates or for a body relative to it."""
        return self.rates or any(get_chief_name(other.motion) == body.name for other in self.bodies)

    def flight_of(self, body: Body, model: CommandedModel) -> CommandedFlight:
        """Return the flight of a model of a body, with or without commands."""
        name = next((name for name, candidate in body.models.items() if candidate is model), "")
        return self.flights.get(name) or model.fly_open_loop()

    def chief(self, name: str) -> Chief:
        """Return the trajectory of a body that is in the tree already."""
        if name not in self.chiefs:
            self.chiefs[name] = Chief(
                self.bodies, name, local=self.local, flights=self.flights, known=(self.epochs, self.states[name])
            )
        return self.chiefs[name]

    def read_state(self, tree: PoseTree, origin: str) -> BodyState:
        """Read position and velocity of the axes at a body's origin from the tree."""
        link = tree.link(ROOT, origin)
        shape = (len(self.epochs), 3)
        return BodyState(np.broadcast_to(link.translation_m, shape), np.broadcast_to(link.velocity_m_s, shape))

    def add_origin(self, tree: PoseTree, body: Body) -> PoseTree:
        """Add the axes at the origin of a body to a tree, and keep states and rates of an orbit."""
        place, relative_to = self._place(body), get_chief_name(body.motion)
        if not body.orbits:
            link = Link((place.position_m, np.eye(3)), place.velocity_m_s, np.zeros(3))
            return tree.with_node(body.origin, relative_to or ROOT, link)
        if relative_to is not None:
            return self._add_relative(tree, body, relative_to, place)
        center = self.centers[body.name] = find_center_states(body.motion, self.epochs)
        link = link_orbit(body.motion, self.epochs, place, center, turns=self.turns(body))
        self.states[body.name] = BodyState(place.position_m, place.velocity_m_s)
        self.turning[body.name] = link.angular_velocity_rad_s
        return tree.with_node(body.origin, ROOT, link)

    def _place(self, body: Body) -> Place:
        """Compute position and velocity of a body's origin in the axes of its motion, and warn of exceeded model limits."""
        motion = body.motion
        if isinstance(motion, PlacedMotion):
            flight = self.flight_of(body, motion) if isinstance(motion, CommandedModel) else None
            return motion.place(self.epochs, flight)
        known: tuple[Any, ...] = (self.epochs,)
        if isinstance(motion, RtnMotion):
            known = self.epochs, self.chief(str(get_chief_name(motion)))
            place = Place(*motion.relative(*known))
        else:
            state = states_of(motion, self.epochs)
            place = Place(state.position_m, state.velocity_m_s)
        if has_warnings_enabled():
            for line in list_exceeded_limits(motion, *known):
                warn(f"{body.name}.motion: {line}")
        return place

    def _add_relative(self, tree: PoseTree, body: Body, chief: str, place: Place) -> PoseTree:
        """Add the rtn axes of a relative motion to a tree, under those of its chief.

        The velocity of the body is that of the chief plus rho' + omega x rho, where omega includes the rotation of the
        chief's orbital plane.

        Parameters
        ----------
        place : position and velocity in the chief's rtn axes
        """
        there, turning, (rho, rho_rate, rates) = tree.link(ROOT, self.by_name[chief].origin), self.turning[chief], place
        moved_m_s = rho_rate if rates is None else rates[0]
        position = there.translation_m + rotate_vectors(there.matrix, rho)
        velocity = self.states[chief].velocity_m_s + rotate_vectors(there.matrix, rho_rate + cross(turning, rho))
        center = self.centers[body.name] = self.centers[chief]
        about = subtract_center(BodyState(position, velocity), center)
        own, own_turning = rtn_matrix(about.position_m, about.velocity_m_s)
        chief_from_own = np.matmul(np.swapaxes(there.matrix, -1, -2), own)
        carried = rotate_vectors(np.swapaxes(chief_from_own, -1, -2), turning)
        # For a body relative to this one, the rotation of the chief's orbital plane is accurate enough: in free flight
        # the two differ by about 1e-9 rad/s per kilometre of distance, which is 1 um/s at a kilometre.
        own_turning[..., 0] = carried[..., 0]
        self.states[body.name], self.turning[body.name] = BodyState(position, velocity), own_turning
        if rates is not None:
            orbit = subtract_center(self.states[chief], center)
            own_turning = find_turning_rad_s(about, place, there, orbit, center, self.chief(chief).central_body)
            self.turning[body.name] = own_turning
            carried = rotate_vectors(np.swapaxes(chief_from_own, -1, -2), there.angular_velocity_rad_s)
        relative = own_turning - carried
        quotient = self.relative_turning.get(body.name, relative)
        # Skip a difference quotient that is unknown, or that differs only by the rounding of matrices over its step.
        link = Link(
            (rho, chief_from_own), moved_m_s, np.where(np.abs(quotient - relative) > ROUNDING_RAD_S, quotient, relative)
        )
        return tree.with_node(body.origin, self.by_name[chief].origin, link)

    def add_body_axes(self, tree: PoseTree, body: Body) -> PoseTree:
        """Add the axes of a body, and the further axes fixed to it, to a tree."""
        orientation = self._orient(tree, body)
        matrix, rate = orientation.rotation.as_matrix(), orientation.rate_rad_s
        if not orientation.in_origin:  # from the root's axes into those of the origin
            base = tree.link(ROOT, body.origin)
            matrix = np.matmul(np.swapaxes(base.matrix, -1, -2), matrix)
            rate = rate - rotate_vectors(np.swapaxes(matrix, -1, -2), base.angular_velocity_rad_s)
        tree = tree.with_node(body.name, body.origin, Link((np.zeros(3), matrix), np.zeros(3), rate))
        for extra in body.axes:
            tree = tree.with_node(extra.name, body.name, extra.link)
        return tree

    def add_hinges(self, tree: PoseTree, body: Body) -> PoseTree:
        """Add the axes of a body's hinges to a tree."""
        if not body.joints:
            return tree
        seen: tuple[np.ndarray | None, np.ndarray | None] = (None, None)
        if self.sun.position_m is not None:
            whole = tree.link(ROOT, body.name)
            line = sun_line(self.situation(tree, body), "joint")
            seen = find_sun_in_body(whole.rotation, whole.angular_velocity_rad_s, *line)
        for joint in body.joints:
            tree = tree.with_node(body.joint_axes(joint), body.name, joint.link(self.epochs.time_s, *seen))
        return tree

    def _orient(self, tree: PoseTree, body: Body) -> Orientation:
        """Compute the attitude of a body: from its attitude law, else from its motion, else constant."""
        situation, attitude = self.situation(tree, body), body.attitude
        if attitude is None and isinstance(body.motion, PlacedMotion):
            turned_by_motion = body.motion.orient(situation)
            if turned_by_motion is not None:
                return turned_by_motion
        return orient(attitude or FixedAttitude(), situation)

    def situation(self, tree: PoseTree, body: Body) -> Situation:
        """Make the situation that the attitude law of a body receives."""
        base = tree.link(ROOT, body.origin)
        to_root = base.rotation
        shape = (len(self.epochs), 3)

        def line(name: str) -> tuple[np.ndarray, np.ndarray]:
            link = tree.link(body.origin, self.by_name[name].origin if name in self.by_name else name)
            relative_m = link.translation_m
            rate = link.velocity_m_s + cross(base.angular_velocity_rad_s, relative_m)
            toward, moving = rotate_vectors(to_root, relative_m), rotate_vectors(to_root, rate)
            return np.broadcast_to(toward, shape), np.broadcast_to(moving, shape)

        def at(epochs: Epochs) -> Situation:
            some = list_dependencies(body, self.bodies)
            there = self.move(
                some, [name for dependency in some for name in (dependency.origin, dependency.name)], epochs
            )
            with suppress_warnings():
                tree = there.evaluate()
            return there.situation(tree, body)

        return Situation(
            self.epochs,
            np.broadcast_to(base.translation_m, shape),
            np.broadcast_to(base.velocity_m_s, shape),
            body.orbits,
            to_root,
            np.broadcast_to(base.angular_velocity_rad_s, shape),
            self.sun.position_m,
            self.local,
            line,
            at,
            lambda name: tree.link(ROOT, self.by_name[name].origin),
            lambda model: self.flight_of(body, model),
            lambda: tuple(chief.motion for chief in list_dependencies(body.replace(attitude=None), self.bodies)),
        )


class Chief:
    """The trajectory of a body relative to which others move.

    Parameters
    ----------
    bodies, name : all bodies, and the name of the chief
    local, flights : as for `truth`
    known : epochs at which the states are known already, and these states
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        name: str,
        *,
        local: bool = False,
        flights: Flights | None = None,
        known: tuple[Epochs, BodyState] | None = None,
    ) -> None:
        self._name, self._local, self._flights = name, local, flights
        self._by_name = {body.name: body for body in bodies}
        self._known = [] if known is None else [known]

    def states(self, epochs: Epochs) -> BodyState:
        """Compute position [m] and velocity [m/s] of the body, each (time, 3), in GCRS axes."""
        for at, states in self._known:
            if at.start_utc == epochs.start_utc and np.array_equal(at.time_s, epochs.time_s):
                return states
        sun = SunVectors(epochs, self._local, None)
        there = _Evaluation(self._chain, self._order, epochs, self._local, sun, self._flights or {}, rates=False)
        with suppress_warnings():
            tree = there.evaluate()
        states = there.states.get(self._name) or there.read_state(tree, self._chain[0].origin)
        if len(epochs) == 1:  # mostly the start, which every relative motion needs repeatedly
            self._known = [*self._known[-3:], (epochs, states)]
        return states

    @property
    def central_body(self) -> CentralBody:
        """The body about which this one orbits."""
        return find_center(self._chain[-1].motion)

    def center_states(self, epochs: Epochs) -> BodyState | None:
        """Compute the states of the centre of that body.

        Parameters
        ----------
        epochs : instants

        Returns
        -------
        position [m] and velocity [m/s], each (time, 3), in GCRS axes; None for the Earth
        """
        return find_center_states(self._chain[-1].motion, epochs)

    def list_breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the times (break,) since `start_utc` [s] of jumps and corners in the states of the body, or of a chief.

        Parameters
        ----------
        epochs : instants that matter
        """
        return list_breaks_s(self._chain, epochs, Chief)

    @property
    def force_model(self) -> ForceModel | None:
        """Forces and maneuvers with which the body's own motion is integrated; None for any other motion."""
        model: ForceModel | None = read_member(
            self._by_name[self._name].motion, "force_model", None, (ForceModel, NoneType), "leave it out"
        )
        return model

    @cached_property
    def _order(self) -> tuple[str, ...]:
        """The names of the axes of that chain, each after what it needs."""
        return tuple(sort_bodies(self._chain, local=self._local))

    @cached_property
    def _chain(self) -> tuple[Body, ...]:
        """The body and the chain of its chiefs, without their attitudes."""
        chain = [self._by_name[self._name]]
        while (relative_to := get_chief_name(chain[-1].motion)) is not None:
            chain.append(self._by_name[relative_to])
        return tuple(body.replace(attitude=None, axes=()) for body in chain)
