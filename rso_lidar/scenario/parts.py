"""The parts of a scenario that join rooms: time, world, target, follower, lidar."""

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.detector import Empirical
from rso_lidar.motion import Body, Mount
from rso_lidar.motion.body import RESERVED
from rso_lidar.optics import Laser, Receiver
from rso_lidar.part import Instant, Part, Positive, Text, Vector
from rso_lidar.scene import Material

_MOST_FRAMES = 5_000_000


class Time(Part):
    """When frames are taken: round(duration_s * frame_rate_hz) of them, at k / frame_rate_hz after `start_utc`."""

    start_utc: Instant
    duration_s: Positive
    frame_rate_hz: Positive

    @model_validator(mode="after")
    def _some_frames(self) -> Self:
        frames = self.duration_s * self.frame_rate_hz
        if frames < 0.5 or round(frames) < 1:
            raise ValueError(
                f"duration_s * frame_rate_hz is {frames:.3g}, which makes no frame; give a longer duration or a higher rate"
            )
        if frames > _MOST_FRAMES:
            raise ValueError(f"duration_s * frame_rate_hz is {frames:.3g} frames, over {_MOST_FRAMES:,}; split the run")
        return self

    @property
    def n_frames(self) -> int:
        """Return how many frames the scenario has."""
        return round(self.duration_s * self.frame_rate_hz)

    def seconds(self, frames: np.ndarray) -> np.ndarray:
        """Return the instants [s since start_utc] of frames by number."""
        return np.asarray(frames, dtype=float) / self.frame_rate_hz


class World(Part):
    """What the root axes are: ``inertial`` is GCRS about the Earth, ``local`` a bench or terrain without an Earth."""

    axes: Literal["inertial", "local"] = "inertial"


class Target(Body):
    """A body with a surface.

    `model` is a name of the catalogue, or, with a suffix or a slash, the path of a mesh. `scale` turns its unit into
    metres, or `size_m` sets its longest side. Without `material` a catalogue model keeps its own, another mesh is the
    seed's Lambertian 0.30; `part_materials` overrides by part. `center_of_mass_m` is the body's origin in the mesh's own
    axes, after scaling.
    """

    model: Text
    scale: Positive | None = None
    size_m: Positive | None = None
    mesh_axes: Literal["z_up", "y_up"] = "z_up"
    material: Material | None = None
    part_materials: dict[Text, Material] = Field(default_factory=dict)
    center_of_mass_m: Vector | None = None

    @model_validator(mode="after")
    def _allowed(self) -> Self:
        if self.name in RESERVED:
            raise ValueError(f"name: '{self.name}' is reserved ({', '.join(RESERVED)}); choose another")
        if self.scale is not None and self.size_m is not None:
            raise ValueError("give scale or size_m, not both")
        return self

    @property
    def is_path(self) -> bool:
        """Return whether `model` names a file rather than a model of the catalogue."""
        return "/" in self.model or "\\" in self.model or "." in self.model


class Follower(Body):
    """The spacecraft that carries the lidar."""

    name: Literal["follower"] = "follower"


class Lidar(Part):
    """The instrument: laser, receiver, detector, and how it is mounted.

    `mount` turns and moves the lidar in the axes of what carries it, the PTU or, without one, the follower; unturned,
    its boresight is their +x and its rows run along −z.
    """

    mount: Mount = Mount()
    laser: Laser = Laser()
    receiver: Receiver
    detector: Empirical = Empirical()

    @property
    def settings(self) -> dict[str, float]:
        """Return what is in force, in SI, as every frame records it."""
        return {
            "laser_energy_j": self.laser.energy_mj * units.MJ,
            "laser_divergence_rad": self.laser.divergence_rad,
            "laser_wavelength_m": self.laser.wavelength_m,
            "pulse_fwhm_s": self.laser.pulse_fwhm_s,
            "focal_length_m": self.receiver.focal_length_m,
            "aperture_m": self.receiver.aperture_m,
        }
