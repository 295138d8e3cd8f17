"""The order in which bodies are evaluated, and the bodies on which an attitude depends."""

from collections.abc import Mapping, Sequence
from graphlib import CycleError, TopologicalSorter

from rso_lidar.errors import ScenarioError, add_place, did_you_mean
from rso_lidar.motion.attitudes.situation import laws_of, looks_at, needs_orbit
from rso_lidar.motion.attitudes.torqued import Torqued
from rso_lidar.motion.bodies.body import RESERVED_AXES, Body
from rso_lidar.motion.motions.motion import get_chief_name, is_attached
from rso_lidar.orbit import EARTH, CentralBody, find_center
from rso_lidar.part import kind_of
from rso_lidar.rpo import RtnMotion


def sort_bodies(bodies: Sequence[Body], *, local: bool) -> list[str]:
    """Sort the names of origin and body axes so that each depends only on earlier ones.

    Parameters
    ----------
    bodies : all bodies
    local : whether the world is local, without an Earth

    Returns
    -------
    names of the axes at each body's origin and of each body, in the order of evaluation

    Raises
    ------
    ScenarioError
        If a name is used twice or unknown, a motion needs an Earth in a local world, a relative motion refers to a body
        that does not orbit, or the dependencies form a loop
    """
    by_name = _by_name(bodies)
    hosts = {axes.name: body for body in bodies for axes in body.axes}
    graph: dict[str, list[str]] = {}
    for body in bodies:
        graph[body.origin] = _origin_needs(body, by_name, local)
        graph[body.name] = [body.origin, *_attitude_needs(body, by_name, hosts, local)]
    try:
        return list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        names = [name.partition(".")[0] for name in error.args[1]]
        chain = " -> ".join(name for name, before in zip(names, [None, *names], strict=False) if name != before)
        raise ScenarioError(
            f"{names[0]}: relative_to and look_at form a loop ({chain}); break it: relate one to another body or to the root"
        ) from None


def list_dependencies(body: Body, bodies: Sequence[Body]) -> list[Body]:
    """List the body itself, the bodies that its attitude looks at, and all bodies relative to which these move.

    A body keeps its attitude only where that matters: if its axes are looked at, or another body is attached to them.
    The body itself is returned without its attitude, unless its own axes matter.
    """
    by_name = {other.name: other for other in bodies}
    hosts = {axes.name: host for host in bodies for axes in host.axes}
    tilted: dict[str, bool] = {}

    def add_dependency(name: str, turned: bool) -> None:
        if tilted.get(name, False) or (name in tilted and not turned):
            return
        tilted[name] = turned
        dependency = by_name[name]
        relative_to = get_chief_name(dependency.motion)
        if relative_to is not None:
            add_dependency(relative_to, is_attached(dependency.motion))
        if turned or dependency is body:
            for at in (at for law in laws_of(dependency.attitude) for at in looks_at(law)):
                add_dependency(at if at in by_name else hosts[at].name, at in hosts)

    add_dependency(body.name, False)
    return [by_name[name] if turned else by_name[name].replace(attitude=None) for name, turned in tilted.items()]


def _by_name(bodies: Sequence[Body]) -> dict[str, Body]:
    seen: set[str] = set()
    for axes in [axes for body in bodies for axes in body.axes]:
        if axes.name in RESERVED_AXES:
            raise ScenarioError(
                f"{axes.name}: this name of axes is reserved ({', '.join(RESERVED_AXES)}); choose another"
            )
    for name in [name for body in bodies for name in (body.name, *(axes.name for axes in body.axes))]:
        if name in seen:
            raise ScenarioError(f"{name}: two bodies or axes have this name; rename one")
        seen.add(name)
    return {body.name: body for body in bodies}


def _origin_needs(body: Body, by_name: dict[str, Body], local: bool) -> list[str]:
    """Name the axes, of the chief or host, that must be known before the origin of a body is placed; empty for root axes.

    Raises
    ------
    ScenarioError
        If the motion does not suit the world, or if its chief is unknown or does not orbit
    """
    motion = body.motion
    if local and body.orbits:
        raise ScenarioError(
            f"{body.name}.motion: '{kind_of(motion)}' needs an Earth, and [world] axes = \"local\" has none; "
            "use 'fixed', 'table' or 'state_space', or leave out [world]"
        )
    if not local and getattr(motion, "axes", None) == "local":
        raise ScenarioError(
            f'{body.name}.motion.axes: "local" is for a root without an Earth; write "inertial", or [world] axes = "local"'
        )
    relative_to = get_chief_name(motion)
    if relative_to is None:
        return []
    if relative_to not in by_name:
        guess = did_you_mean(relative_to, by_name)
        raise ScenarioError(
            f"{body.name}.motion.relative_to: unknown body '{relative_to}'{guess} (bodies: {', '.join(by_name)})"
        )
    chief = by_name[relative_to]
    if is_attached(motion):
        return [chief.name]
    if not chief.orbits:
        raise ScenarioError(
            f"{body.name}.motion.relative_to: '{relative_to}' does not orbit, so it has no rtn axes; "
            "give it an orbit, or use motion 'fixed' or 'table'"
        )
    if isinstance(motion, RtnMotion):
        with add_place(f"{body.name}.motion"):
            motion.check_center(find_center_of_body(body, by_name))
    return [chief.origin]


def find_center_of_body(body: Body, by_name: Mapping[str, Body]) -> CentralBody:
    """Return the body about which another orbits: that of the first chief in its chain of chiefs.

    Parameters
    ----------
    body : the body that orbits
    by_name : all bodies
    """
    seen = {body.name}
    while (relative_to := get_chief_name(body.motion)) in by_name and relative_to not in seen:
        body = by_name[str(relative_to)]
        seen.add(body.name)
    return find_center(body.motion)


def _attitude_needs(body: Body, by_name: dict[str, Body], hosts: dict[str, Body], local: bool) -> list[str]:
    """List the axes that must be known before the attitude of a body is computed: those at which it looks.

    Raises
    ------
    ScenarioError
        If the attitude needs an orbit that the body lacks, or if the motion already turns the body
    """
    needs = []
    for law in laws_of(body.attitude):
        if needs_orbit(law) and (local or not body.orbits):
            raise ScenarioError(
                f"{body.name}.attitude: '{kind_of(law)}' needs a body that orbits; use 'fixed', 'spin' or 'look_at'"
            )
        if isinstance(law, Torqued) and (center := find_center_of_body(body, by_name)) is not EARTH:
            raise ScenarioError(
                f"{body.name}.attitude: 'torqued' knows the Earth's shadow and air, and the body orbits {center.name}; "
                "use 'tumble'"
            )
        needs += [_find_target_axes(at, body, by_name, hosts) for at in looks_at(law)]
    if getattr(body.motion, "turns", False) and body.attitude is not None:
        raise ScenarioError(
            f"{body.name}.attitude: its motion is a rigid body, which already determines the attitude; leave one out"
        )
    return needs


def _find_target_axes(at: str, body: Body, by_name: dict[str, Body], hosts: dict[str, Body]) -> str:
    """Find the axes whose position a body needs to look at a name.

    Raises
    ------
    ScenarioError
        If the body looks at itself or at an unknown name
    """
    if at in by_name:
        if at == body.name:
            raise ScenarioError(f"{body.name}.attitude.at: a body cannot look at itself; name another")
        return by_name[at].origin
    if at in hosts:
        return hosts[at].name
    known = [*by_name, *hosts]
    guess = did_you_mean(at, known)
    raise ScenarioError(f"{body.name}.attitude.at: unknown name '{at}'{guess} (known: {', '.join(known)})")
