"""Times of the frames, and the root axes."""

import operator
from collections.abc import Iterable
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar.errors import ScenarioError
from rso_lidar.part import Direction, Flag, Fraction, Instant, Part, Positive

_MOST_FRAMES = 5_000_000


class Time(Part):
    """Times of the frames: round(duration_s * frame_rate_hz) of them, at k / frame_rate_hz after `start_utc`.

    Where `lidar.laser.pulse_rate_hz` spreads several pulses over time, that is the first pulse, and the time of the frame is
    the middle of its pulses.
    """

    start_utc: Instant = Field(
        description="Start of the scenario, such as `2024-09-17T12:00:00Z`; a time without an offset is an error."
    )
    duration_s: Positive = Field(description="Duration of the scenario [s].")
    frame_rate_hz: Positive = Field(
        description="Laser flashes per second [Hz]: round(duration × rate) frames at times k / rate, the end excluded."
    )

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
        """Number of frames."""
        return round(self.duration_s * self.frame_rate_hz)

    def seconds(self, frames: np.ndarray) -> np.ndarray:
        """Return the times [s since start_utc] of frames.

        Parameters
        ----------
        frames : indices of frames (time)
        """
        return np.asarray(frames, dtype=float) / self.frame_rate_hz

    def choose_frames(self, frames: slice | Iterable[int] | None) -> np.ndarray:
        """Return the indices (time) of the frames that are chosen.

        Parameters
        ----------
        frames : ascending indices, or a slice (None: all)

        Raises
        ------
        ScenarioError
            If they are not frames of this scenario.
        """
        n_frames = self.n_frames
        if frames is None:
            return np.arange(n_frames)
        try:
            chosen: Any = (
                np.arange(n_frames)[frames] if isinstance(frames, slice) else [operator.index(k) for k in frames]
            )
            numbers = np.array(chosen)
        except (TypeError, ValueError, OverflowError):
            raise ScenarioError(
                f"frames: need a slice or whole numbers, not {frames!r:.60}; such as range(0, 10)"
            ) from None
        if not len(numbers):
            raise ScenarioError(f"frames: the choice is empty; the scenario has frames 0 to {n_frames - 1}")
        if numbers[0] < 0 or numbers[-1] >= n_frames or np.any(np.diff(numbers) <= 0):
            raise ScenarioError(f"frames: need ascending numbers from 0 to {n_frames - 1}")
        return numbers


def parse_frames(text: str | None) -> slice | None:
    """Parse the choice of frames of the command line.

    Parameters
    ----------
    text : ``A``, ``A:B`` or ``A:B:STEP`` (None: all frames)

    Returns
    -------
    slice or None
        Of numbers of frames, as `Time.choose_frames` takes it; None for all.

    Raises
    ------
    ScenarioError
        For another text.

    >>> parse_frames("0:10:2"), parse_frames("7")
    (slice(0, 10, 2), slice(7, 8, None))
    """
    if text is None:
        return None
    try:
        ends = [int(word) if word else None for word in text.split(":")]
        if len(ends) == 1 and ends[0] is not None:
            return slice(ends[0], ends[0] + 1)
        if len(ends) in (2, 3) and (len(ends) == 2 or ends[2] is None or ends[2] > 0):
            return slice(*ends)
    except ValueError:
        pass
    raise ScenarioError(f"--frames {text}: is not A:B or A:B:STEP; write for example 0:100")


class World(Part):
    """The root axes: ``inertial`` is GCRS about the Earth, ``local`` a bench or terrain without an Earth.

    A local world has a Sun only where `sun_direction` gives one, from the origin toward it in root axes. Nothing eclipses
    that Sun. `light_time` and `earth_albedo` choose effects of light that are left out by default.
    """

    axes: Literal["inertial", "local"] = Field(
        default="inertial",
        description=(
            "Root axes. `inertial`: GCRS about the Earth. `local`: a bench without an Earth, where orbits are refused."
        ),
    )
    sun_direction: Direction | None = Field(
        default=None,
        description=(
            "Direction to the Sun in `local` axes; if omitted, there is no Sun. In `inertial` axes the date "
            "determines it."
        ),
    )

    light_time: Flag = Field(
        default=False,
        description=(
            "Whether light takes time: targets stand where it meets them, and range is half of its path. By default, all "
            "poses of a flash are those at its emission."
        ),
    )

    earth_albedo: Fraction | None = Field(
        default=None,
        description=(
            "Albedo of the Earth, a Lambertian sphere, for the sunlight that it reflects onto targets (Earthshine). If "
            "omitted, there is none of that light. The Bond albedo is 0.3; clouds reach 0.7. Needs `filter_width_nm`."
        ),
    )

    @property
    def motion_arguments(self) -> dict[str, Any]:
        """Keyword arguments `local` and `sun_direction` by which `motion` knows the world."""
        return {"local": self.axes == "local", "sun_direction": self.sun_direction}

    @model_validator(mode="after")
    def _one_sun(self) -> Self:
        if self.earth_albedo is not None and self.axes == "local":
            raise ValueError('earth_albedo is for axes = "inertial"; a local world has no Earth, so leave it out')
        if self.sun_direction is not None and self.axes != "local":
            raise ValueError('sun_direction is for axes = "local"; in inertial axes the date says where the Sun is')
        return self
