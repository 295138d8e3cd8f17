"""Positions of Sun, Moon and planets from a kernel of the JPL, which the user gives; nothing is downloaded.

The built-in Sun is within 0.0105 degree and the built-in Moon within 18 arcseconds, which is enough for light and shadow. A
kernel such as de421.bsp or de440s.bsp is good to milliarcseconds, and knows the planets.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError, did_you_mean
from rso_lidar.files import check_regular, explain_unreadable
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.records import BodyState
from rso_lidar.shipped import find


@dataclass(frozen=True)
class JplEphemeris:
    """A kernel of the JPL (SPK, .bsp) on the user's disk.

    Parameters
    ----------
    path : path of the kernel

    Raises
    ------
    ScenarioError
        if there is no such file, or it is no kernel with the Earth in it
    """

    path: str | Path

    def __post_init__(self) -> None:
        place = find(self.path)
        if place is None:
            raise ScenarioError(f"{self.path}: no such file; give the path of a kernel of the JPL, such as de440s.bsp")
        check_regular(place, sys.maxsize, ScenarioError, "kernel (SPK, .bsp)")
        object.__setattr__(self, "path", place)
        with self._open() as kernel:
            if 399 not in kernel.codes:
                raise ScenarioError(f"{self.path}: does not contain the Earth; give a kernel such as de440s.bsp")

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies in the kernel."""
        with self._open() as kernel:
            return tuple(sorted(names[-1].lower() for code, names in kernel.names().items() if code != 0))

    def position_m(self, body: str, epochs: Epochs, *, light_time: bool = True) -> np.ndarray:
        """Return the position (time, 3) [m] of a body from the Earth's centre, in GCRS axes.

        Parameters
        ----------
        body : name of the body, such as "sun", "moon" or "venus barycenter"
        epochs : instants
        light_time : whether the position is the apparent one, as of the light that arrives: that of `sun_position_m` and
            `moon_position_m`. Without it, the position is the geometric one

        Raises
        ------
        ScenarioError
            if the kernel does not have the body
        PropagationError
            if epochs are outside the kernel; its `bad` masks them
        """
        with self._open() as kernel:
            place = self._read(kernel, body, epochs)
            for _ in range(2 if light_time else 0):  # the second round changes the Moon by 1 m, the Sun by 2 mm
                ago_s = np.sqrt(np.sum(place**2, axis=-1)) / units.SPEED_OF_LIGHT_M_S
                place = self._read(kernel, body, Epochs(epochs.start_utc, epochs.time_s - ago_s))
        return place

    def states(self, body: str, epochs: Epochs) -> BodyState:
        """Return the geometric states (time, 3) [m], [m/s] of a body relative to the Earth's centre, in GCRS axes.

        Parameters
        ----------
        body : name of the body, such as "moon"
        epochs : instants

        Raises
        ------
        ScenarioError
            if the kernel does not have the body
        PropagationError
            if epochs are outside the kernel; its `bad` masks them
        """
        with self._open() as kernel:
            state = self._look_up(kernel, body, epochs)
        return BodyState(*(np.ascontiguousarray(vectors.T) for vectors in (state.position.m, state.velocity.m_per_s)))

    def _read(self, kernel: Any, body: str, epochs: Epochs) -> np.ndarray:
        """Read the geometric position (time, 3) [m] of a body from the Earth's centre."""
        place: np.ndarray = np.ascontiguousarray(self._look_up(kernel, body, epochs).position.m.T)
        return place

    def _look_up(self, kernel: Any, body: str, epochs: Epochs) -> Any:
        """Look up a body, as seen from the Earth's centre, in skyfield's form."""
        from skyfield.errors import EphemerisRangeError

        try:
            path = kernel[body] - kernel[399]
        except (KeyError, ValueError):
            names = self.bodies
            guess = did_you_mean(body.lower(), names) if isinstance(body, str) else ""
            raise ScenarioError(
                f"{self.path}: has no body '{body!s:.40}'{guess} (bodies: {', '.join(names)})"
            ) from None
        try:
            return path.at(epochs.skyfield_time())
        except EphemerisRangeError as error:
            begin, end = (time.utc_strftime("%Y-%m-%d") for time in (error.start_time, error.end_time))
            bad = np.asarray(error.time_mask)
            raise PropagationError(
                f"{self.path}: does not cover {int(bad.sum())} of {len(bad)} epochs: it spans {begin} to {end}; give "
                "another kernel",
                bad,
            ) from None
        except (TypeError, ValueError, OSError):
            raise ScenarioError(f"{self.path}: is cut short; fetch it again") from None

    @contextmanager
    def _open(self) -> Iterator[Any]:
        from skyfield.jpllib import SpiceKernel

        try:
            kernel = SpiceKernel(str(self.path))
        except (OSError, ValueError, EOFError, struct.error) as error:
            if isinstance(error, OSError):
                raise ScenarioError(explain_unreadable(self.path, error)) from None
            raise ScenarioError(
                f"{self.path}: is not a kernel (SPK, .bsp); give a kernel of the JPL, such as de440s.bsp"
            ) from None
        try:
            yield kernel
        finally:
            kernel.close()
