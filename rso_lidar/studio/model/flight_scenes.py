"""Views of a flight in space: orbits, relative motion, and the lidar with its target, under the stars.

The sky is dark in both schemes of the page, as images are.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from rso_lidar.imaging import Camera
from rso_lidar.picture import DARK, is_about_earth, osculating_orbit_m
from rso_lidar.pose import ROOT
from rso_lidar.studio.model.flight import PreviewFlight
from rso_lidar.studio.model.space_scene import SpaceScene
from rso_lidar.units import DEG, EARTH_RADIUS_M

_CAMERA_LINES = (3, 2, 0)  # colours of cameras, among those of lines
_BODY_M = 0.12  # size of the drawn body of a camera: that of a usual navigation camera, assumed
_MM = 1e-6  # 1,000 km, the unit of views of orbits


def draw_orbit(flight: PreviewFlight, row: int) -> SpaceScene:
    """Draw the Earth and the orbits of all bodies in inertial axes, in units of 1,000 km."""
    scene, truth = SpaceScene("orbit", DARK), flight.truth(row)
    radius = EARTH_RADIUS_M * _MM
    scene.sky(np.eye(3), truth.sun_direction)
    scene.earth(radius, (0.0, 0.0, 0.0))
    turn = np.linspace(0.0, 2.0 * np.pi, 97)
    for angle in np.arange(-60.0, 61.0, 30.0) * DEG:
        ring = [np.cos(turn) * np.cos(angle), np.sin(turn) * np.cos(angle), np.full(97, np.sin(angle))]
        scene.path(1.003 * radius * np.stack(ring, axis=1), DARK.quiet, opacity=0.35)
    for angle in np.arange(0.0, 180.0, 30.0) * DEG:
        ring = [np.cos(turn) * np.cos(angle), np.cos(turn) * np.sin(angle), np.sin(turn)]
        scene.path(1.003 * radius * np.stack(ring, axis=1), DARK.quiet, opacity=0.35)
    farthest, entries = radius, []
    for name, colour in zip(truth.states, itertools.cycle(DARK.lines), strict=False):
        state = truth.states[name]
        if np.linalg.norm(state.position_m) < 0.9 * EARTH_RADIUS_M:
            continue  # a body of local axes, near their origin
        states = [at.truth.states[name] for at in flight.moments]
        flown_m, flown_m_s = np.stack([at.position_m for at in states]), np.stack([at.velocity_m_s for at in states])
        orbit = flown = flown_m * _MM
        if is_about_earth(np.array([at.truth.time_s for at in flight.moments]), flown_m, flown_m_s):
            orbit = osculating_orbit_m(state.position_m, state.velocity_m_s) * _MM
            scene.path(orbit, colour, opacity=0.6)
        scene.path(flown, colour)
        scene.add("points", [state.position_m * _MM], colour, size=9)
        entries.append((colour, name))
        farthest = max(farthest, float(np.linalg.norm(orbit, axis=1).max()))
    scene.label("N", (0.0, 0.0, 1.12 * radius))
    # From the follower's side, above the equator and across the Sun's light, so that day, night and the follower are seen.
    here, across = (
        _unit(truth.states["follower"].position_m),
        np.cross([0.0, 0.0, 1.0], np.nan_to_num(truth.sun_direction)),
    )
    across *= np.copysign(1.0, across @ here)
    scene.look(max(3.5 * farthest, 4.6 * radius) * _unit(0.7 * here + across + np.array([0.0, 0.0, 0.6])))
    scene.header["legend"] = {"title": "Orbits, graticule 30°", "entries": entries}
    return scene


def draw_relative(flight: PreviewFlight, row: int) -> SpaceScene:
    """Draw the path of the follower about the first target, in the target's rtn axes [m]."""
    scene, path = SpaceScene("relative", DARK), flight.path_m
    corners = np.array([path.min(axis=0, initial=0.0), path.max(axis=0, initial=0.0)])
    middle, span = corners.mean(axis=0), max(0.5 * float(np.linalg.norm(np.ptp(corners, axis=0))), 1.0)
    rtn = flight.axes.endswith(".rtn")
    scene.axes(np.eye(4), 0.35 * span, "rtn" if rtn else flight.axes)
    scene.path(path, DARK.lines[0])
    scene.add("points", [path[row]], DARK.mark, size=10)
    scene.label(f"follower, {np.linalg.norm(path[row]):,.1f} m", path[row])
    scene.label(flight.base, (0.0, 0.0, 0.0))
    _add_targets(scene, flight, row)
    eye = middle + 3.8 * span * np.array([0.35, -0.25, -1.0] if rtn else [0.2, -1.0, 0.5])
    scene.look(eye, middle, (1.0, 0.0, 0.0) if rtn else (0.0, 0.0, 1.0))
    scene.header["legend"] = {"title": flight.axes, "entries": [(DARK.lines[0], "path"), (DARK.mark, "now")]}
    return scene


def draw_target(flight: PreviewFlight, row: int) -> SpaceScene:
    """Draw the first target in its attitude, in the Sun's light, with the field of view and the beam about it [m]."""
    pose, lidar = flight.matrix(row, flight.base), flight.matrix(row, "lidar")
    scene = SpaceScene("target", DARK, pose[:3, 3])
    size = max((surface.radius_m for surface in flight.scenario.surfaces if surface.body == flight.base), default=1.0)
    _add_targets(scene, flight, row)
    _add_lidar(scene, flight, row)
    at_origin = pose.copy()
    at_origin[:3, 3] = 0.0
    scene.axes(at_origin, 1.3 * size, flight.base)
    toward = _unit(lidar[:3, 3] - pose[:3, 3])
    right, up = lidar[:3, 0], -lidar[:3, 1]  # as in the images
    scene.look(3.4 * size * _unit(toward + 0.3 * right + 0.25 * up), up=up)
    return scene


def draw_lidar(flight: PreviewFlight, row: int) -> SpaceScene:
    """Draw follower, PTU and lidar with their axes, the field of view and the beam to the target [m]."""
    lidar = flight.matrix(row, "lidar")
    scene = SpaceScene("lidar", DARK, lidar[:3, 3])
    for name, length in (("follower", 1.2), ("ptu", 0.8), ("lidar", 0.6)):
        if name in flight.truth(row).poses:
            pose = flight.matrix(row, name)
            pose[:3, 3] -= lidar[:3, 3]
            scene.axes(pose, length, name)
    _add_targets(scene, flight, row)
    _add_lidar(scene, flight, row)
    boresight, down = lidar[:3, 2], lidar[:3, 1]
    scene.look(-3.5 * boresight - 1.4 * down + 1.2 * lidar[:3, 0], 2.0 * boresight, -down)
    return scene


VIEWS: dict[str, Callable[[PreviewFlight, int], SpaceScene]] = {
    "orbit": draw_orbit, "relative": draw_relative, "target": draw_target, "lidar": draw_lidar,
}  # fmt: skip


def _unit(vector: np.ndarray) -> np.ndarray:
    vector = np.nan_to_num(np.asarray(vector, float))
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-12 else np.array([0.0, 0.0, 1.0])


def _dash(line: np.ndarray) -> np.ndarray:
    """Return the dashes (dash, 2, xyz) of a line through points (point, xyz), about a hundred in all."""
    steps = max(1, round(200 / (len(line) - 1)))
    share = np.linspace(0.0, 1.0, steps, endpoint=False)[:, None]
    fine = np.concatenate([begin + share * (end - begin) for begin, end in itertools.pairwise(line)] + [line[-1:]])
    return np.stack([fine[:-1], fine[1:]], axis=1)[::2]


def _add_targets(scene: SpaceScene, flight: PreviewFlight, row: int) -> None:
    """Add the meshes of all targets in their attitudes, the angles of hinges included, the sky, and the Earth."""
    truth, origin = flight.truth(row), scene.origin_m
    for surface in flight.scenario.surfaces:
        pose = flight.matrix(row, surface.name)
        pose[:3, 3] -= origin
        item = {"kind": "model", "content": flight.models[surface.name][0], "matrix": pose.T.ravel().tolist()}
        scene.header["items"].append(item)
        if "." in surface.name:
            scene.label(surface.name, pose[:3, 3])
    from_root = truth.pose(flight.axes, ROOT)
    scene.sky(from_root.rotation.as_matrix(), truth.sun_direction, truth.sunlit.get(flight.base, 1.0))
    if not flight.scenario.is_local:
        scene.earth(EARTH_RADIUS_M, from_root.translation - origin)


def mark_sight(scene: SpaceScene, flight: PreviewFlight, row: int, point_m: np.ndarray, words: str) -> None:
    """Mark a measured point in a view in metres, with the line of sight to it.

    Parameters
    ----------
    point_m : (xyz) [m] in lidar axes
    """
    pose = flight.matrix(row, "lidar")
    here, there = pose[:3, 3] - scene.origin_m, pose[:3, :3] @ point_m + pose[:3, 3] - scene.origin_m
    scene.add("lines", [here, there], DARK.mark, opacity=0.7)
    scene.mark(there, words)


def _add_lidar(scene: SpaceScene, flight: PreviewFlight, row: int) -> None:
    """Add the pyramid of the field of view and the beam, as far as the first target."""
    origin = scene.origin_m
    lidar, far = flight.moments[row].lidar, flight.range_m(row)
    far = far if np.isfinite(far) and far > 0.0 else 100.0
    pose, lines = flight.matrix(row, "lidar"), DARK.lines
    wide, high = lidar.receiver.field_edge
    t, turn = lidar.laser.half_width_tangent, np.linspace(0.0, 2.0 * np.pi, 49)
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]], float)
    is_round = lidar.laser.footprint in ("circle", "gaussian")
    beam = t * (np.stack([np.cos(turn), np.sin(turn)], axis=1) if is_round else square)
    for outline, colour in ((square * [wide, high], lines[4]), (beam, lines[1])):
        rim = far * np.column_stack([outline, np.ones(len(outline))]) @ pose[:3, :3].T + pose[:3, 3] - origin
        corners = rim[:: len(rim) // 4][:4]
        edges = np.stack([np.broadcast_to(pose[:3, 3] - origin, corners.shape), corners], axis=1)
        for line in (rim, *edges):  # the beam is dashed: it often ends where the field does
            scene.add("lines", _dash(line) if colour == lines[1] else np.stack([line[:-1], line[1:]], axis=1), colour)
    entries = [(lines[4], "field of view"), (lines[1], "beam (dashed)")]
    for camera, number in zip(flight.scenario.camera, itertools.cycle(_CAMERA_LINES), strict=False):
        _add_camera(scene, flight.matrix(row, camera.name), camera, far, lines[number])
        entries.append((lines[number], f"field of camera {camera.name}"))
    scene.header["legend"] = {"title": f"at {far:,.1f} m", "entries": entries}


def _add_camera(scene: SpaceScene, pose: np.ndarray, camera: Camera, far: float, colour: str) -> None:
    """Add the body of a camera beside the lidar, its name, and the pyramid of its field of view.

    Parameters
    ----------
    pose : (4, 4) of the camera in the axes of the view
    far : length of the pyramid [m]
    """
    turn, place = pose[:3, :3], pose[:3, 3] - scene.origin_m
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]], float)

    def outline(half: Any, ahead: float) -> np.ndarray:
        """Return the corners (5, xyz) of a rectangle across the boresight."""
        corners: np.ndarray = np.column_stack([square * half, np.full(5, ahead)]) @ turn.T + place
        return corners

    edge = np.asarray(camera.lens.field_edge, float)
    back, front, lens, rim = (
        outline(_BODY_M / 2.0, -_BODY_M),
        outline(_BODY_M / 2.0, 0.0),
        outline(_BODY_M / 4.0, _BODY_M / 3.0),
        outline(far * edge, far),
    )
    for line in (back, front, lens, rim):
        scene.path(line, colour)
    for begin, end in ((back, front), (front, lens), (np.broadcast_to(place, rim.shape), rim)):
        scene.add("lines", np.stack([begin[:4], end[:4]], axis=1), colour)
    scene.label(camera.name, place)
