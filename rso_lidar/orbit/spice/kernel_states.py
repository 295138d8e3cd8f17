"""Motion of a body by SPICE kernels, and the attitude of a frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.spice.kernel_pool import find_ephemeris_times, find_tdb_rate, load_kernels
from rso_lidar.part import Part, Text
from rso_lidar.records import BodyState

_EARTH = 399  # NAIF's number of the Earth's centre
_MOST_EDGES = 100_000
_GREATEST_NUMBER = 2**31 - 1  # of a body, for the toolkit


class SpiceMotion(Part):
    """Motion of a body by SPICE kernels of the user: an SPK of any type, and what it needs beside.

    Requires the extra `spice`. States are geometric, relative to the Earth's centre, in the toolkit's J2000 axes, which are
    those of ICRF. If the kernel has another centre than the Earth, a kernel that joins them (such as de440s.bsp) is among
    the `kernels`. Names need a kernel that states them (FK); NAIF's numbers do not.
    """

    type: Literal["spice"] = "spice"
    kernels: Annotated[tuple[Text, ...], Field(min_length=1)] = Field(
        description="Paths of the kernels, in the order in which they are loaded; later ones have priority."
    )
    body: Text = Field(description="Name of the body, or NAIF's number of it, such as '-98'.")

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes.

        Raises
        ------
        PropagationError
            if epochs are outside the kernels; its `bad` masks them
        """
        times_s, rest_s = find_ephemeris_times(epochs)
        with load_kernels(self.kernels, f"spice {self.body}") as spice:
            number = _find_body(spice, self.body)
            rows = np.full((len(times_s), 6), np.nan)
            why = ""
            for k, time_s in enumerate(times_s.tolist()):
                try:
                    rows[k] = spice.spkez(number, time_s, "J2000", "NONE", _EARTH)[0]
                except spice.utils.exceptions.SpiceSPKINSUFFDATA as error:
                    why = why or " ".join(str(error.long).split())
        bad = np.isnan(rows).any(axis=1)
        if bad.any():
            raise PropagationError(
                f"spice {self.body}: the kernels do not cover {int(bad.sum())} of {len(bad)} epochs, first at time_s = "
                f"{epochs.time_s[np.argmax(bad)]:g}; shift or shorten the run, or add a kernel ({why:.160})",
                bad,
            )
        if not rows[:, :3].any(axis=1).all():
            raise ScenarioError(f"spice {self.body}: is at the Earth's centre; name the body of a craft")
        velocity_m_s = rows[:, 3:] * units.KM * (1.0 + find_tdb_rate(times_s))[:, None]
        return shift_states(BodyState(rows[:, :3] * units.KM, velocity_m_s), rest_s)

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the times [s] since the `start_utc` of `epochs` at which segments of the body begin and end.

        Parameters
        ----------
        epochs : instants
        """
        start_s, rest_s = find_ephemeris_times(Epochs(epochs.start_utc, np.zeros(1)))
        edges: set[float] = set()
        with load_kernels(self.kernels, f"spice {self.body}") as spice:
            number = _find_body(spice, self.body)
            for k in range(spice.ktotal("SPK")):
                handle = spice.kdata(k, "SPK")[3]
                spice.dafbfs(handle)
                while spice.daffna() and len(edges) < _MOST_EDGES:
                    span, what = spice.dafus(spice.dafgs(5), 2, 6)
                    if int(what[0]) == number:
                        edges |= {float(span[0]), float(span[1])}
        breaks: np.ndarray = np.array(sorted(edges)) - (start_s[0] + rest_s[0])
        return breaks


def _find_body(spice: Any, body: str) -> int:
    """Return NAIF's number of a body by its name or number, or raise `ScenarioError`."""
    if body.isascii() and body.removeprefix("-").isdigit():
        if abs(int(body)) > _GREATEST_NUMBER:
            raise ScenarioError(f"spice {body}: is no number of NAIF's, which have 32 bits; correct it")
        return int(body)
    try:
        return int(spice.bodn2c(body))
    except spice.utils.exceptions.NotFoundError:
        raise ScenarioError(
            f"spice {body}: no kernel knows that name; give the body's number, or add a kernel (FK) with its name"
        ) from None


def shift_states(states: BodyState, by_s: np.ndarray) -> BodyState:
    """Shift states by up to a millisecond each, with the acceleration of the Earth as a point."""
    radius_m = np.linalg.norm(states.position_m, axis=-1)[:, None]
    step_s = by_s[:, None]
    change = -units.EARTH_GM_M3_S2 * states.position_m / radius_m**3 * step_s
    moved_m = states.position_m + (states.velocity_m_s + 0.5 * change) * step_s
    return BodyState(moved_m, states.velocity_m_s + change)


def read_spice_attitude(kernels: Sequence[str], frame: str, epochs: Epochs) -> tuple[np.ndarray, np.ndarray]:
    """Read the attitude of a frame from SPICE kernels.

    Parameters
    ----------
    kernels : paths of a CK with its SCLK, an FK, and what they need beside
    frame : name of the frame
    epochs : instants

    Returns
    -------
    gcrs_from_frame : (time, 3, 3)
    rate_rad_s : (time, 3) angular velocity relative to GCRS axes, in axes of the frame [rad/s]

    Raises
    ------
    PropagationError
        if the kernels have no attitude with a rate at some epochs; its `bad` masks them
    ScenarioError
        if the extra `spice` is not installed, a kernel cannot be read, or no kernel knows the frame
    """
    from scipy.spatial.transform import Rotation

    times_s, rest_s = find_ephemeris_times(epochs)
    turned, rate = np.full((len(times_s), 3, 3), np.nan), np.full((len(times_s), 3), np.nan)
    why = ""
    with load_kernels(kernels, f"spice {frame}") as spice:
        if spice.namfrm(frame) == 0:
            raise ScenarioError(f"spice {frame}: no kernel knows that frame; add a kernel (FK) that defines it")
        for k, time_s in enumerate(times_s.tolist()):
            try:
                matrix, spin = spice.xf2rav(spice.sxform("J2000", frame, time_s))
            except (spice.utils.exceptions.SpiceNOFRAMECONNECT, spice.utils.exceptions.SpiceCKINSUFFDATA) as error:
                why = why or " ".join(str(error.long).split())
                continue
            turned[k], rate[k] = np.transpose(matrix), np.dot(matrix, spin)
    bad = np.isnan(rate).any(axis=1)
    if bad.any():
        raise PropagationError(
            f"spice {frame}: the kernels have no attitude with its rate at {int(bad.sum())} of {len(bad)} epochs, first at "
            f"time_s = {epochs.time_s[np.argmax(bad)]:g}; shift or shorten the run, or add a kernel ({why:.160})",
            bad,
        )
    shifted = Rotation.from_matrix(turned) * Rotation.from_rotvec(rate * rest_s[:, None])
    matrices: np.ndarray = shifted.as_matrix()
    return matrices, rate
