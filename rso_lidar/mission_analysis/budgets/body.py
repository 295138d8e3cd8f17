"""The body of a budget: a target of a scenario, or a model alone before a camera."""

from __future__ import annotations

import datetime

from rso_lidar.errors import ScenarioError
from rso_lidar.motion import Fixed
from rso_lidar.scenario import Follower, Lidar, Scenario, Target, Time, World

_AHEAD_M = 1000.0  # where the body stands before it is moved; any range does


def choose_body(lidar: Lidar, scenario: Scenario | None, body: str | None) -> tuple[Scenario, int]:
    """Choose a body by name: a target of the scenario, or else a model or a mesh alone before the camera.

    Parameters
    ----------
    scenario : the scenario of the camera, if any
    body : name of a target or of a model, or path of a mesh (None: the scenario's first target)

    Returns
    -------
    the scenario of the body, and its index there.

    Raises
    ------
    ScenarioError
        If there is no such body.
    """
    names = [] if scenario is None else [target.name for target in scenario.target]
    if body is None:
        if scenario is None or not names:
            where = "a camera alone has no body" if scenario is None else "the scenario has no target"
            raise ScenarioError(f"body: {where}; name a model, such as cubesat_3u, or the path of a mesh")
        return scenario, 0
    if not isinstance(body, str) or not body.strip():
        raise ScenarioError(f"body: {body!r:.60}: is not a name; give a target, a model or the path of a mesh")
    if scenario is not None and body in names:
        return scenario, names.index(body)
    try:
        alone = _build_bench(lidar, body)
        _ = alone.surfaces
    except ScenarioError as error:
        raise ScenarioError(f"body: {body}: {_explain(str(error), names)}") from None
    return alone, 0


def _build_bench(lidar: Lidar, model: str) -> Scenario:
    """Build a scenario without an Earth in which a model stands before a lidar, for one frame that holds all its pulses."""
    frame_s = max(1.0, 2.0 * lidar.exposure_s)
    return Scenario(
        version=1,
        name=model,
        world=World(axes="local"),
        time=Time(
            start_utc=datetime.datetime(2000, 1, 1, tzinfo=datetime.UTC),
            duration_s=frame_s,
            frame_rate_hz=1.0 / frame_s,
        ),
        target=(Target(name="body", model=model, motion=Fixed(position_m=(_AHEAD_M, 0.0, 0.0))),),
        follower=Follower(motion=Fixed(position_m=(0.0, 0.0, 0.0))),
        lidar=lidar,
    )


def _explain(message: str, names: list[str]) -> str:
    """Return what is wrong with a body, and the targets that a scenario has."""
    text = message.rpartition("target body: ")[2]
    return f"no target of that name (targets: {', '.join(names)}), and no model: {text}" if names else text
