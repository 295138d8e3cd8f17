"""The instrument of a scenario: laser, receiver, detector, what of it changes with time, and presets by name."""

from __future__ import annotations

import numbers
import tomllib
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from rso_lidar import units
from rso_lidar.detector import Detector, Gsfl
from rso_lidar.errors import ScenarioError, did_you_mean, placed
from rso_lidar.motion import Mount
from rso_lidar.optics import Laser, Receiver, read_files
from rso_lidar.part import NotNegative, Number, Part, Positive, Text
from rso_lidar.records import Command

_MOST_STEPS = 2**14  # of time in one trace, and ...
_MOST_GATED = 2**27  # ... in all pixels under a gate: half a gigabyte

# Of these a user's choice replaces the preset's, whichever of the two it is.
_EITHER = ({"fov_deg", "focal_length_mm"}, {"f_number", "aperture_mm"})


@cache
def presets() -> dict[str, dict[str, Any]]:
    """Return the shipped cameras by name, as TOML tables of `[lidar]` with a line `what`."""
    return tomllib.loads(Path(__file__).with_name("presets.toml").read_text(encoding="utf-8"))


class Schedule(Part):
    """Settings that follow a plan: at `time_s` the lists hold; between, they are interpolated or stay (``step``).

    Before the first instant and after the last the first and last values hold. Lists left out do not change. A zoom lens
    keeps its `f_number` where the receiver gives that, and its aperture where it gives `aperture_mm`.
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
            raise ValueError("time_s must rise from entry to entry; sort it")
        if not self.planned:
            raise ValueError(f"nothing is planned; give a list for one of {', '.join(_PLANNED)}")
        for name in self.planned:
            if len(getattr(self, name)) != len(self.time_s):
                raise ValueError(
                    f"{name} has {len(getattr(self, name))} entries and time_s {len(self.time_s)}; match them"
                )
        return self

    @property
    def planned(self) -> tuple[str, ...]:
        """Return the names of the settings that follow the plan."""
        return tuple(name for name in _PLANNED if getattr(self, name) is not None)

    def at(self, time_s: float) -> dict[str, float]:
        """Return the planned settings at an instant [s since start_utc], by name."""
        if self.interpolation == "step":
            place = max(int(np.searchsorted(self.time_s, time_s, "right")) - 1, 0)
            return {name: float(getattr(self, name)[place]) for name in self.planned}
        return {name: float(np.interp(time_s, self.time_s, getattr(self, name))) for name in self.planned}


_COMMANDS = {  # of a controller: what each sets of the plan, and the unit there
    "focal_length_m": ("focal_length_mm", units.MM),
    "divergence_rad": ("divergence_deg", units.DEG),
    "energy_j": ("energy_mj", units.MJ),
    "gate_delay_s": ("gate_delay_ns", units.NS),
}
_PLANNED = ("focal_length_mm", "divergence_deg", "energy_mj", "gate_delay_ns")


class Lidar(Part):
    """The instrument: laser, receiver, detector, and how it is mounted.

    `preset` names a shipped camera whose values hold where none are given here. `mount` turns and moves the lidar in the
    axes of what carries it, the PTU or, without one, the follower; unturned, its boresight is their +x and its rows run
    along −z. A `schedule` plans zoom, diffuser, energy and gate; a controller's commands come before it.
    """

    preset: Text | None = Field(
        default=None,
        description="Name of a shipped camera, whose values apply where none are given here (docs/instrument.md).",
    )
    mount: Mount = Field(
        default=Mount(),
        description=(
            "Pose ptu_from_lidar, or follower_from_lidar without a PTU. Without rotation the boresight is the "
            "carrier's +x."
        ),
    )
    laser: Laser = Field(default=Laser(), description="Laser.")
    receiver: Receiver = Field(description="Lens and focal plane.")
    detector: Detector = Field(default_factory=Gsfl, description="Detector: photons to range and intensity.")
    schedule: Schedule | None = Field(
        default=None, description="Planned changes of the instrument's settings. If omitted, the settings are constant."
    )

    @model_validator(mode="before")
    @classmethod
    def _from_preset(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        detector = given.get("detector")
        if isinstance(detector, dict) and "type" not in detector and "preset" not in given:
            given = {**given, "detector": {"type": "gsfl", **detector}}
        name = given.get("preset")
        if not isinstance(name, str):
            return given
        if name not in presets():
            raise ValueError(
                f"preset: no camera '{name}'{did_you_mean(name, presets())} (known: {', '.join(presets())})"
            )
        return _laid_over({key: value for key, value in presets()[name].items() if key != "what"}, given)

    @model_validator(mode="after")
    def _gate_for_the_plan(self) -> Self:
        gated = isinstance(self.detector, Gsfl) and self.detector.gate is not None
        if self.schedule is not None and self.schedule.gate_delay_ns is not None and not gated:
            raise ValueError("schedule.gate_delay_ns needs a gate; add [lidar.detector.gate]")
        return self

    @property
    def changes_lens(self) -> bool:
        """Return whether the plan turns the zoom lens, and so the pixels' lines of sight."""
        return self.schedule is not None and self.schedule.focal_length_mm is not None

    @property
    def max_returns(self) -> int:
        """Return how many returns of a pixel are listed."""
        return self.detector.max_returns if isinstance(self.detector, Gsfl) else 1

    def at(self, time_s: float, command: Command | None = None) -> Lidar:
        """Return the instrument with what is in force at an instant [s since start_utc], as planned and commanded."""
        wanted = self.schedule.at(time_s) if self.schedule else {}
        with placed("simulate: the controller's command" if command else "lidar.schedule"):
            wanted |= _asked(command) if command else {}
            return _with(self, tuple(wanted.items())) if wanted else self

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed; another preset brings its own values where the old one's held."""
        new = changes.get("preset")
        if new is not None and self.preset is not None and new != self.preset:
            old = Lidar(preset=self.preset)  # type: ignore[call-arg]
            for name in ("laser", "receiver", "detector"):
                part, before = getattr(self, name), getattr(old, name)
                if name in changes or type(part) is not type(before):
                    continue
                kept = {key for key in part.model_fields_set if getattr(part, key) != getattr(before, key)}
                changes[name] = {key: getattr(part, key) for key in kept}
        return super().replace(**changes)

    def check(self) -> None:
        """Read all files, which must have been found, and refuse an axis of time too long to work on."""
        lenses = {self.receiver}
        if self.schedule is not None and self.schedule.focal_length_mm is not None:
            ends = min(self.schedule.focal_length_mm), max(self.schedule.focal_length_mm)
            lenses |= {_with(self, (("focal_length_mm", end),)).receiver for end in ends}
        for receiver in lenses:
            read_files(self.laser, receiver)
        if not isinstance(self.detector, Gsfl):
            return
        plan = self.detector.plan(self.laser.pulse_fwhm_s)
        steps = plan.before + plan.watched + plan.after
        if steps > _MOST_STEPS:
            raise ScenarioError(
                f"a pulse of {self.laser.pulse_fwhm_s / units.NS:.3g} ns, samples of {self.detector.readout.sample_ns:.3g} "
                f"ns and {self.detector.amplifier.bandwidth_mhz:.3g} MHz need {steps:.3g} steps of time for each pixel, "
                f"over {_MOST_STEPS:,}; bring laser.pulse_fwhm_ns, detector.readout and detector.amplifier nearer"
            )
        if self.detector.gate is not None:
            n_pixels = self.receiver.n_rows * self.receiver.n_cols
            stored = self.detector.gate.n_samples(self.detector.readout.sample_s) * plan.steps_per_sample
            if stored * n_pixels > _MOST_GATED:
                most_ns = _MOST_GATED / n_pixels * plan.step_s / units.NS
                raise ScenarioError(
                    f"detector.gate.width_ns: {self.detector.gate.width_ns:g} in {n_pixels:,} pixels is more than can be "
                    f"stored; take up to {most_ns:.0f}, or fewer pixels"
                )

    @property
    def settings(self) -> dict[str, float]:
        """Return what is in force, in SI, as every frame records it."""
        settings = {
            "laser_energy_j": self.laser.energy_mj * units.MJ,
            "laser_divergence_rad": self.laser.divergence_rad,
            "laser_wavelength_m": self.laser.wavelength_m,
            "pulse_fwhm_s": self.laser.pulse_fwhm_s,
            "focal_length_m": self.receiver.focal_length_m,
            "aperture_m": self.receiver.aperture_m,
        }
        if isinstance(self.detector, Gsfl) and self.detector.gate is not None:
            settings["gate_delay_s"] = self.detector.gate.delay_ns * units.NS
            settings["gate_width_s"] = self.detector.gate.width_ns * units.NS
        return settings


def _laid_over(preset: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a preset's table with the user's over it, key by key; a part of another type replaces the preset's whole."""
    result = dict(preset)
    for pair in _EITHER:
        if pair & set(given):
            result = {key: value for key, value in result.items() if key not in pair}
    for key, value in given.items():
        old = result.get(key)
        mixes = isinstance(old, Mapping) and old.get("type") == _type(value, old)
        if mixes and isinstance(value, Part):
            value = {name: getattr(value, name) for name in value.model_fields_set}
        result[key] = _laid_over(old, value) if mixes and isinstance(value, Mapping) else value  # type: ignore[arg-type]
    return result


def _type(value: Any, old: Mapping[str, Any]) -> Any:
    """Return the type that a table says it is, or that it leaves to the preset."""
    if isinstance(value, Mapping):
        return value.get("type", old.get("type"))
    return getattr(value, "type", old.get("type"))


def _asked(command: Command) -> dict[str, float]:
    """Return what a controller asks of the instrument, by the names of a schedule, or raise `ScenarioError`."""
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


@lru_cache(maxsize=64)
def _with(lidar: Lidar, wanted: tuple[tuple[str, float], ...]) -> Lidar:
    values = dict(wanted)
    changes: dict[str, Any] = {}
    light = {name: values[name] for name in ("divergence_deg", "energy_mj") if name in values}
    if light:
        changes["laser"] = lidar.laser.replace(**light)
    if "focal_length_mm" in values:
        changes["receiver"] = lidar.receiver.replace(fov_deg=None, focal_length_mm=values["focal_length_mm"])
    if "gate_delay_ns" in values:
        gate = lidar.detector.gate if isinstance(lidar.detector, Gsfl) else None
        if gate is None:
            raise ScenarioError("gate_delay_s: the detector has no gate; add [lidar.detector.gate]")
        changes["detector"] = lidar.detector.replace(gate=gate.replace(delay_ns=values["gate_delay_ns"]))
    return lidar.replace(**changes)
