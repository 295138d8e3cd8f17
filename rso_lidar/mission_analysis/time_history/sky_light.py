"""Sun, Earth and Moon about the boresight over time, and the stray light that they put on the focal plane."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from functools import partial

import numpy as np

from rso_lidar import optics, scene
from rso_lidar.motion import find_moon_m
from rso_lidar.optics import STRAY_BODIES, veil_on_axis
from rso_lidar.orbit import angle_rad, earth_limb_angle_rad
from rso_lidar.pose import ROOT, rotate_vectors
from rso_lidar.processes import map_parts
from rso_lidar.records import Truth
from rso_lidar.scenario import Scenario

_MOST = 200  # frames at which stray light is computed; it is interpolated between them


def tabulate_sky(
    scenario: Scenario, truth: Truth, frames: np.ndarray, executor: Executor | None = None
) -> dict[str, np.ndarray]:
    """Tabulate the angles of Earth and Moon off the boresight, and with glare the stray light; nothing in a local world.

    Parameters
    ----------
    frames : (time) indices of the frames
    executor : whose workers compute stray light (None: threads of this process)

    Returns
    -------
    Columns (time) by name. The limb's angle is negative where the boresight meets the Earth.
    """
    table = {} if scenario.is_local else _tabulate_angles(scenario, truth, frames)
    if scenario.lidar.receiver.glare is None:
        return table
    rows = np.unique(np.linspace(0, frames.size - 1, _MOST).round().astype(int))
    _ = scenario.surfaces
    truths = [truth.at(row) for row in rows.tolist()]
    light = np.array(map_parts(partial(_find_sky_lights, scenario), truths, executor))
    names = [*(f"{body}_veil_photons_per_s" for body in STRAY_BODIES), "sky_image_photons_per_s"]
    known = dict(zip(names, light.T, strict=True))
    return table | {name: np.interp(np.arange(frames.size), rows, values) for name, values in known.items()}


def _find_sky_lights(scenario: Scenario, truths: Sequence[Truth]) -> list[np.ndarray]:
    return [find_sky_light(scenario, truth) for truth in truths]


def find_sky_light(scenario: Scenario, truth: Truth) -> np.ndarray:
    """Return the stray light of Sun, Earth and Moon in a pixel on the boresight, and the brightest pixel of their images.

    Returns
    -------
    (4) photons per second. Targets hide what is behind them from the lens; the images are those without targets.
    """
    lidar = scenario.instrument.at(float(truth.time_s))
    moon_m = scenario.moon_position_m(float(truth.time_s))
    sky = optics.see_sky(lidar.laser, lidar.receiver, truth, moon_m, has_earth=not scenario.is_local)
    if sky is None:
        return np.zeros(len(STRAY_BODIES) + 1)
    hidden = scene.find_hidden(sky.direction, scenario.surfaces, truth)
    return np.append(veil_on_axis(sky, lidar.receiver, hidden), sky.image_photons_per_s.max())


def _tabulate_angles(scenario: Scenario, truth: Truth, frames: np.ndarray) -> dict[str, np.ndarray]:
    """Tabulate the angles from the boresight to the Earth's limb and to the Moon's centre [rad]."""
    position_m = np.broadcast_to(truth.states["follower"].position_m, (frames.size, 3))
    ahead = rotate_vectors(truth.poses.place(ROOT, "lidar")[1], np.array([0.0, 0.0, 1.0]))
    boresight = np.broadcast_to(ahead, position_m.shape)
    return {
        "earth_limb_off_boresight_rad": earth_limb_angle_rad(boresight, position_m),
        "moon_off_boresight_rad": angle_rad(
            boresight, find_moon_m(scenario.bodies, scenario.epochs(frames)) - position_m
        ),
    }
