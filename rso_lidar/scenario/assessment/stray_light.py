"""Warnings about stray light: how much noise Sun, Earth and Moon add where they are nearest to the field of view."""

from __future__ import annotations

import numpy as np

from rso_lidar import detector, optics
from rso_lidar.optics import STRAY_BODIES, veil_on_axis
from rso_lidar.scenario.mission.mission import Mission
from rso_lidar.scenario.preview.geometry import Preview
from rso_lidar.scenario.preview.sky import SkyGeometry
from rso_lidar.ties import find_first_greatest, find_first_least

_EPOCHS = 8  # evenly over the run, beside those at which a body is nearest
_LOUDER = 1.05  # noise in stray light over noise in the dark, from which a warning is given


def advise_on_glare(mission: Mission, preview: Preview, around: SkyGeometry) -> list[str]:
    """Warn of stray light that makes pixels noisier, at the worst of a few epochs; nothing without glare."""
    if mission.lidar.receiver.glare is None:
        return []
    if mission.is_local and mission.world.sun_direction is None:
        return [
            "lidar.receiver.glare is of Sun, Earth and Moon, and this local world has none of them; set "
            "world.sun_direction, or leave the glare out"
        ]
    if mission.is_local and "sun" not in mission.lidar.receiver.glare.sources:
        return [
            "lidar.receiver.glare.sources has no Sun, and this local world has no Earth and no Moon: frames have no glare; "
            'add "sun", or leave the glare out'
        ]
    nearest = [around.sun_angle_rad, around.earth_limb_angle_rad, around.moon_angle_rad]
    rows = [find_first_least(angle) for angle in nearest if angle is not None and np.all(np.isfinite(angle))]
    rows += np.linspace(0, len(preview.time_s) - 1, _EPOCHS).round().astype(int).tolist()
    light = np.zeros((len(rows), len(STRAY_BODIES)))
    image = np.zeros(len(rows))
    for number, row in enumerate(rows):
        truth = preview.truth.at(int(row))
        lidar = mission.instrument.at(float(truth.time_s))
        moon_m = mission.moon_position_m(float(truth.time_s))
        sky = optics.see_sky(lidar.laser, lidar.receiver, truth, moon_m, has_earth=not mission.is_local)
        if sky is not None:
            light[number], image[number] = veil_on_axis(sky, lidar.receiver), sky.image_photons_per_s.max()
    worst = find_first_greatest(light.sum(axis=1) + image)
    total = float(light[worst].sum() + image[worst])
    louder = detector.noise_growth(mission.instrument.detector, total)
    if louder < _LOUDER:
        return []
    body = STRAY_BODIES[find_first_greatest(light[worst])]
    what = (
        "light of the sky in the field"
        if image[worst] > light[worst].sum()
        else f"glare, mostly of the {body.title()},"
    )
    return [
        f"{what} makes the noise of a pixel {louder:.2f} times that in the dark at {preview.time_s[rows[worst]]:g} s "
        f"({total:.2g} photons/s); turn the boresight away, add lidar.receiver.glare.baffle, or narrow "
        "lidar.receiver.filter_width_nm"
    ]
