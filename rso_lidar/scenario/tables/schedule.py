"""Settings of the instrument that change with time, planned or commanded."""

import numbers
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.errors import ScenarioError
from rso_lidar.part import NotNegative, Number, Part, Positive
from rso_lidar.records import Command

_PLANNED = ("focal_length_mm", "divergence_deg", "energy_mj", "gate_delay_ns")
_COMMANDS = {  # field of a Command: the setting of a schedule that it replaces, and the unit of that
    "focal_length_m": ("focal_length_mm", units.MM),
    "divergence_rad": ("divergence_deg", units.DEG),
    "energy_j": ("energy_mj", units.MJ),
    "gate_delay_s": ("gate_delay_ns", units.NS),
}


class Schedule(Part):
    """Planned settings: each list gives values at the times `time_s`.

    Between those times values are interpolated, or the last one holds (``step``). Before the first and after the last
    time the first and the last value hold. Settings without a list do not change. A zoom lens keeps its `f_number` or its
    `aperture_mm`, whichever the receiver gives.
    """

    time_s: tuple[Number, ...] = Field(description="Times since `start_utc`, ascending [s].")
    interpolation: Literal["linear", "step"] = Field(
        default="linear", description="Interpolation between times: `linear`, or `step`, which holds the last value."
    )
    focal_length_mm: tuple[Positive, ...] | None = Field(
        default=None, description="Focal length of a zoom lens, one value per time [mm]."
    )
    divergence_deg: tuple[Annotated[Positive, Field(lt=180)], ...] | None = Field(
        default=None, description="Full divergence angle of an adjustable diffuser, one value per time [deg]."
    )
    energy_mj: tuple[Positive, ...] | None = Field(default=None, description="Pulse energy, one value per time [mJ].")
    gate_delay_ns: tuple[NotNegative, ...] | None = Field(
        default=None, description="Time from emission to the opening of the range gate, one value per time [ns]."
    )

    @model_validator(mode="after")
    def _lists_match(self) -> Self:
        if not self.time_s:
            raise ValueError("time_s is empty; give at least one instant")
        if np.any(np.diff(self.time_s) <= 0.0):
            raise ValueError("time_s does not increase; sort it")
        if not self.planned:
            raise ValueError(f"no setting is planned; give a list for one of {', '.join(_PLANNED)}")
        for name in self.planned:
            if len(getattr(self, name)) != len(self.time_s):
                raise ValueError(
                    f"{name} has {len(getattr(self, name))} entries and time_s {len(self.time_s)}; match them"
                )
        return self

    @property
    def planned(self) -> tuple[str, ...]:
        """Names of the settings that the schedule plans."""
        return tuple(name for name in _PLANNED if getattr(self, name) is not None)

    def at(self, time_s: float) -> dict[str, float]:
        """Return the planned settings at one time, by name.

        Parameters
        ----------
        time_s : time [s since start_utc]
        """
        before = max(int(np.searchsorted(self.time_s, time_s, "right")) - 1, 0)
        after, share = before, 0.0
        if self.interpolation == "linear" and before + 1 < len(self.time_s):
            after = before + 1
            from_s, to_s = self.time_s[before], self.time_s[after]
            share = min(max((time_s - from_s) / (to_s - from_s), 0.0), 1.0)  # a slope could overflow, a share cannot
        planned = ((name, getattr(self, name)) for name in self.planned)
        return {name: float(values[before] + share * (values[after] - values[before])) for name, values in planned}


def read_command(command: Command) -> dict[str, float]:
    """Return the settings of a controller's command, by the names of a schedule, or raise `ScenarioError`."""
    asked = {}
    for field, (name, unit) in _COMMANDS.items():
        value = getattr(command, field)
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, numbers.Real):
            raise ScenarioError(f"{field}: needs a number, not {value!r:.60}; give one, or None to leave it")
        try:
            asked[name] = float(value) / unit
        except OverflowError:
            raise ScenarioError(f"{field}: is a number beyond all reason; check its unit") from None
    return asked
