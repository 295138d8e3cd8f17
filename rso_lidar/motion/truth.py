"""Where everything is at each epoch: the tree of axes (seed 3.1.1), for all epochs in one vectorised go."""

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar.errors import RsoLidarWarning, ScenarioError, placed
from rso_lidar.motion.attitude import FixedAttitude, LookAt, LvlhCcsds, Rtn, Spin, Tumble, look_at
from rso_lidar.motion.body import Body, working_order
from rso_lidar.motion.ephemeris import Fixed, Table
from rso_lidar.motion.epochs import Epochs
from rso_lidar.motion.hill import Hill, rtn_axes
from rso_lidar.motion.kepler import semi_major_axis_m
from rso_lidar.motion.sun import sun_position_m, sunlit_fraction
from rso_lidar.pose import ROOT, Link, PoseTree, pose, turned
from rso_lidar.records import BodyState, Truth
from rso_lidar.units import EARTH_GM_M3_S2


def truth(
    bodies: Sequence[Body],
    epochs: Epochs,
    *,
    local: bool = False,
    sun_direction: Sequence[float] | np.ndarray | None = None,
) -> Truth:
    """Return poses, rates and states of all bodies at all epochs, as one batch; ``truth.at(k)`` is one epoch of it.

    Each body has two nodes: its origin in axes that do not turn with it (``tdrs.rtn`` where it orbits, ``plate.origin``
    where it does not), and under that its body axes. A relative motion hangs under the rtn axes of its chief, so that a
    relative pose is composed without inertial coordinates. `local` says that the root has no Earth; only there a
    `sun_direction` in root axes may be given, of any length, for a Sun that nothing hides.
    """
    tree = PoseTree({}, {})
    states: dict[str, BodyState] = {}
    by_origin = {body.origin: body for body in bodies}
    by_name = {body.name: body for body in bodies}
    for name in working_order(bodies, local=local):
        if name in by_origin:
            body = by_origin[name]
            with placed(f"{body.name}.motion"):
                tree = _with_origin(tree, body, by_name, epochs)
            states[body.name] = _state(tree, name, len(epochs))
        else:
            with placed(f"{name}.attitude"):
                tree = _with_attitude(tree, by_name[name], by_name, epochs)
    states = {body.name: states[body.name] for body in bodies}
    return Truth(epochs.time_s, tree, states, *_sun(states, epochs, local, sun_direction))


def _sun(
    states: dict[str, BodyState], epochs: Epochs, local: bool, given: Sequence[float] | np.ndarray | None
) -> tuple[np.ndarray, None, dict[str, np.ndarray]]:
    """Return directions (time, 3) to the Sun, no pointing, and by body the share (time) of the Sun that it sees."""
    shape = (len(epochs), 3)
    if not local:
        if given is not None:
            raise ScenarioError("sun_direction: with an Earth the Sun is where the date says; leave it out")
        position = sun_position_m(epochs)
        lit = {name: sunlit_fraction(state.position_m, position) for name, state in states.items()}
        return position / np.linalg.norm(position, axis=1, keepdims=True), None, lit
    if given is None:
        return np.full(shape, np.nan), None, {}
    direction = np.asarray(given, dtype=float)
    length = np.linalg.norm(direction)
    if direction.shape != (3,) or not 0.0 < length < math.inf:
        raise ScenarioError("sun_direction: needs a vector of three finite numbers that are not all zero")
    return np.broadcast_to(direction / length, shape), None, {name: np.ones(len(epochs)) for name in states}


@contextmanager
def unwarned() -> Iterator[None]:
    """Keep still about what the run itself has warned of, where its bodies are worked out once more on the side."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RsoLidarWarning)
        yield


def _state(tree: PoseTree, origin: str, n_epochs: int) -> BodyState:
    link = tree.link(ROOT, origin)
    shape = (n_epochs, 3)
    return BodyState(np.broadcast_to(link.pose.translation, shape), np.broadcast_to(link.velocity_m_s, shape))


def _with_origin(tree: PoseTree, body: Body, by_name: dict[str, Body], epochs: Epochs) -> PoseTree:
    """Return the tree with the axes at a body's origin."""
    motion = body.motion
    if isinstance(motion, Fixed | Table):
        position, velocity = motion.positions(epochs.time_s)
        return tree.with_node(body.origin, motion.relative_to or ROOT, Link(pose(position), velocity, np.zeros(3)))
    if isinstance(motion, Hill):
        return _with_hill(tree, body, by_name, epochs)
    state = motion.states(epochs)
    rotation, rate = rtn_axes(state.position_m, state.velocity_m_s)
    return tree.with_node(body.origin, ROOT, Link(pose(state.position_m, rotation), state.velocity_m_s, rate))


def mean_motion_rad_s(chief: Body, by_name: dict[str, Body], epochs: Epochs) -> float:
    """Return the mean motion [rad/s] of a body's osculating orbit at start_utc."""
    chain, link = [chief], chief
    while isinstance(link.motion, Hill):
        link = by_name[link.motion.relative_to]
        chain.append(link)
    bare = [body.replace(attitude=None, axes=()) for body in chain]
    with unwarned():
        start = truth(bare, Epochs(epochs.start_utc, np.zeros(1))).states[chief.name]
    semi_major_m = float(semi_major_axis_m(start.position_m[0], start.velocity_m_s[0]))
    if not 0.0 < semi_major_m < math.inf:
        raise ScenarioError(
            f"{chief.name}.motion: an open orbit has no mean motion for 'hill' about it; use 'state' or 'kepler'"
        )
    return math.sqrt(EARTH_GM_M3_S2 / semi_major_m**3)


def _with_hill(tree: PoseTree, body: Body, by_name: dict[str, Body], epochs: Epochs) -> PoseTree:
    """Return the tree with a relative orbit under the rtn axes of its chief.

    The mean motion is that of the chief's osculating semi-major axis at start_utc, whatever the chief's own model.
    """
    assert isinstance(body.motion, Hill)
    chief = by_name[body.motion.relative_to]
    relative_m, relative_m_s = body.motion.relative(epochs.time_s, mean_motion_rad_s(chief, by_name, epochs))
    chief_link = tree.link(ROOT, chief.origin)
    turn = chief_link.pose.rotation
    rate = chief_link.angular_velocity_rad_s
    position = chief_link.pose.translation + turned(turn, relative_m)
    velocity = chief_link.velocity_m_s + turned(turn, relative_m_s + np.cross(rate, relative_m))
    own_turn, own_rate = rtn_axes(position, velocity)
    chief_from_own = turn.inv() * own_turn
    link = Link(pose(relative_m, chief_from_own), relative_m_s, own_rate - turned(chief_from_own.inv(), rate))
    return tree.with_node(body.origin, chief.origin, link)


def _with_attitude(tree: PoseTree, body: Body, by_name: dict[str, Body], epochs: Epochs) -> PoseTree:
    """Return the tree with a body's axes under its origin's."""
    rotation, rate, axes = _turn(tree, body, by_name, epochs)
    if axes == ROOT:  # from the root's axes into those of the origin
        base = tree.link(ROOT, body.origin)
        rotation = base.pose.rotation.inv() * rotation
        rate = rate - turned(rotation.inv(), base.angular_velocity_rad_s)
    tree = tree.with_node(body.name, body.origin, Link(pose(rotation=rotation), np.zeros(3), rate))
    for extra in body.axes:
        tree = tree.with_node(extra.name, body.name, extra.link)
    return tree


def _turn(tree: PoseTree, body: Body, by_name: dict[str, Body], epochs: Epochs) -> tuple[Rotation, np.ndarray, str]:
    """Return axes_from_body, the body rate relative to those axes, and which they are: the root's or the origin's."""
    attitude, motion = body.attitude, body.motion
    if attitude is None and isinstance(motion, Table):
        turning = motion.orientations(epochs.time_s)
        if turning is not None:
            return *turning, body.origin
    if attitude is None:
        attitude = FixedAttitude()
    if isinstance(attitude, Rtn | LvlhCcsds):
        return attitude.rtn_from_body(), np.zeros(3), body.origin
    if isinstance(attitude, LookAt):
        return *_look(tree, body, attitude, by_name, epochs), ROOT
    assert isinstance(attitude, FixedAttitude | Spin | Tumble)
    fixed_to_host = isinstance(attitude, FixedAttitude) and not body.orbits
    return *attitude.orientation(epochs.time_s), body.origin if fixed_to_host else ROOT


def _look(
    tree: PoseTree, body: Body, attitude: LookAt, by_name: dict[str, Body], epochs: Epochs
) -> tuple[Rotation, np.ndarray]:
    seen = by_name[attitude.at].origin if attitude.at in by_name else attitude.at
    link, base = tree.link(body.origin, seen), tree.link(ROOT, body.origin)
    relative_m = link.pose.translation
    to_root = base.pose.rotation
    line = turned(to_root, relative_m)
    rate = turned(to_root, link.velocity_m_s + np.cross(base.angular_velocity_rad_s, relative_m))
    if attitude.up is not None:
        up = np.array(attitude.up, dtype=float)
    elif body.orbits:
        up = turned(to_root, np.array([0.0, 0.0, 1.0]))
    else:
        up = np.array([0.0, 0.0, 1.0])
    shape = (len(epochs), 3)
    return look_at(*(np.broadcast_to(vectors, shape) for vectors in (line, rate, up)))
