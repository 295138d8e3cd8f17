"""An orbit integrated from an orbit parameter message (CCSDS OPM), with the message's maneuvers."""

from __future__ import annotations

import datetime
import math
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from rso_lidar import units
from rso_lidar.errors import PropagationError, ScenarioError
from rso_lidar.orbit.ccsds.state_message import OrbitParameterMessage, StatedManeuver
from rso_lidar.orbit.earth.earth_orientation import EarthOrientation
from rso_lidar.orbit.epochs import Epochs
from rso_lidar.orbit.propagation.forces import Forces
from rso_lidar.orbit.propagation.maneuver import Burn, Impulse
from rso_lidar.orbit.propagation.numerical import integrate_orbit
from rso_lidar.part import Flag, Part, Text
from rso_lidar.records import BodyState


class Opm(Part):
    """Integration from the state of a CCSDS OPM (keyword = value or XML), which flies the maneuvers of the message.

    The integration begins at the epoch of the message, so maneuvers before `start_utc` are flown too. A maneuver without
    duration is an impulse. One with a change of mass is a burn of constant thrust on a mass that decreases from MASS, and
    of the specific impulse that gives its delta-v by Tsiolkovsky's equation; one without is a constant acceleration. RTN
    and TNW axes turn with the orbit during a burn. Areas and coefficients of the message are not used: `forces` has those
    of drag and sunlight.
    """

    type: Literal["opm"] = "opm"
    file: Text = Field(description="Path of a CCSDS OPM (KVN or XML).")
    forces: Forces = Field(default=Forces(), description="Forces besides the central gravity.")
    maneuvers: Flag = Field(default=True, description="Whether the maneuvers of the message are flown.")
    earth_orientation_file: Text | None = Field(
        default=None,
        description=(
            "Path of the IERS file finals2000A.all, with polar motion and UT1, for a state in ITRF. If omitted, its "
            "position is wrong by up to 0.9 arcsecond of its distance: 30 m in low orbit, 180 m in GEO."
        ),
    )

    def states(self, epochs: Epochs) -> BodyState:
        """Return position [m] and velocity [m/s] (time, 3) in GCRS axes.

        Raises
        ------
        PropagationError
            if the orbit meets the Earth; its `bad` masks the epochs beyond
        """
        message = self._read()
        start = message.state
        flight = integrate_orbit(
            np.array(start.position_m),
            np.array(start.velocity_m_s),
            start.epoch_utc,
            self.forces,
            self._list_maneuvers(message),
        )
        try:
            rows = flight(epochs.since(start.epoch_utc))
        except PropagationError as error:
            raise PropagationError(f"opm {self.file}: from its EPOCH, {error}", error.bad) from None
        return BodyState(rows[:, :3], rows[:, 3:])

    def breaks_s(self, epochs: Epochs) -> np.ndarray:
        """Return the times [s] since the `start_utc` of `epochs` at which velocity or acceleration jumps.

        Parameters
        ----------
        epochs : instants
        """
        message = self._read()
        ahead_s = _find_lead_s(message, epochs.start_utc)
        return np.array([at_s + ahead_s for each in self._list_maneuvers(message) for at_s in each.edges_s])

    def list_impulses_s(self, start_utc: datetime.datetime) -> list[float]:
        """Return the times of the impulses, since the start of a run [s].

        Parameters
        ----------
        start_utc : start of the run
        """
        message = self._read()
        ahead_s = _find_lead_s(message, start_utc)
        return [each.at_s + ahead_s for each in self._list_maneuvers(message) if isinstance(each, Impulse)]

    def summarize(self, start_utc: datetime.datetime) -> str:
        """Return the motion in a few words: the object, its epoch and its maneuvers.

        Parameters
        ----------
        start_utc : start of the run; not used
        """
        message = self._read()
        known = self._list_maneuvers(message)
        words = [f"opm of {message.object_name or Path(self.file).stem}, {message.state.epoch_utc:%Y-%m-%dT%H:%M:%SZ}"]
        if known:
            total_m_s = math.fsum(each.size_m_s for each in known)
            words.append(f"{len(known)} maneuver{'s' * (len(known) > 1)} of {total_m_s:.4g} m/s")
        return "; ".join(words)

    def _read(self) -> OrbitParameterMessage:
        file = self.earth_orientation_file
        return OrbitParameterMessage.from_file(self.file, None if file is None else EarthOrientation.from_file(file))

    def _list_maneuvers(self, message: OrbitParameterMessage) -> tuple[Impulse | Burn, ...]:
        return make_maneuvers(message) if self.maneuvers else ()


def make_maneuvers(message: OrbitParameterMessage) -> tuple[Impulse | Burn, ...]:
    """Make the impulses and burns of a message, whose times count from the epoch of its state.

    Raises
    ------
    ScenarioError
        if a burn changes the mass and the message does not give it, or uses all of it
    """
    maneuvers: list[Impulse | Burn] = []
    mass_kg = message.mass_kg
    for k, stated in enumerate(message.maneuvers, start=1):
        maneuvers.append(_make_maneuver(stated, mass_kg, f"{message.where}: maneuver {k}"))
        if mass_kg is not None:
            mass_kg += stated.delta_mass_kg
    return tuple(maneuvers)


def _make_maneuver(stated: StatedManeuver, mass_kg: float | None, where: str) -> Impulse | Burn:
    """Make an impulse, or a burn of a mass at ignition, or raise `ScenarioError`."""
    size_m_s = math.hypot(*stated.delta_v_m_s)
    if stated.duration_s == 0.0:
        return Impulse(at_s=stated.ignition_s, delta_v_m_s=stated.delta_v_m_s, axes=stated.axes)
    x, y, z = (component / stated.duration_s for component in stated.delta_v_m_s)
    if stated.delta_mass_kg == 0.0 or size_m_s == 0.0:
        return Burn(
            from_s=stated.ignition_s, duration_s=stated.duration_s, acceleration_m_s2=(x, y, z), axes=stated.axes
        )
    if mass_kg is None:
        raise ScenarioError(f"{where} changes the mass, which the message does not give; add MASS before it")
    left_kg = mass_kg + stated.delta_mass_kg
    if not left_kg > 0.0:
        raise ScenarioError(
            f"{where}: uses {-stated.delta_mass_kg:g} kg of {mass_kg:g} kg; correct MASS or MAN_DELTA_MASS"
        )
    exhaust_m_s = size_m_s / math.log(mass_kg / left_kg)
    scale_kg = -stated.delta_mass_kg * exhaust_m_s / size_m_s  # thrust is the flow of mass times the exhaust velocity
    return Burn(
        from_s=stated.ignition_s,
        duration_s=stated.duration_s,
        thrust_n=(x * scale_kg, y * scale_kg, z * scale_kg),
        mass_kg=mass_kg,
        isp_s=exhaust_m_s / units.STANDARD_GRAVITY_M_S2,
        axes=stated.axes,
    )


def _find_lead_s(message: OrbitParameterMessage, start_utc: datetime.datetime) -> float:
    """Return the time from the start of a run to the epoch of a message [s]."""
    return -float(Epochs(start_utc, np.zeros(1)).since(message.state.epoch_utc)[0])
