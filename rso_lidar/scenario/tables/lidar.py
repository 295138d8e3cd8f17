"""The instrument of a scenario: laser, receiver, detector and mount."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from functools import lru_cache
from typing import Annotated, Any, Self

from pydantic import Field, ValidationInfo, model_validator

from rso_lidar import units
from rso_lidar.detector import (
    AnyDetector,
    Gsfl,
    LaserPulse,
    ThresholdCondition,
    check_maps,
    check_noise,
    check_size,
    check_traits,
    list_determined,
    solve_threshold,
)
from rso_lidar.errors import ScenarioError, add_place, did_you_mean
from rso_lidar.motion import Mount
from rso_lidar.optics import Laser, Receiver, read_files
from rso_lidar.part import Part, Text, Whole
from rso_lidar.records import Command
from rso_lidar.scenario.tables.calibration import Calibration
from rso_lidar.scenario.tables.presets import PRESET_SUFFIX, load_preset_file, load_presets
from rso_lidar.scenario.tables.schedule import Schedule, read_command

# Settings that every frame records.
_SETTINGS = (
    "laser_energy_j",
    "laser_divergence_rad",
    "laser_wavelength_m",
    "pulse_fwhm_s",
    "focal_length_m",
    "aperture_m",
)
_EXPOSURE = "exposure_s"  # recorded where the pulses of a frame are spread over time
# Keys of which exactly one may be given: a user's choice replaces the preset's.
_ALTERNATIVES = ({"fov_deg", "focal_length_mm"}, {"f_number", "aperture_mm"})


class Lidar(Part):
    """The instrument: laser, receiver, detector, and how it is mounted.

    `preset` names a shipped camera that gives the defaults, or the preset file of a camera of your own, whose values are
    then written out in its place. `mount` is the pose of the lidar in the axes of the PTU, or of
    the follower where there is no PTU. At the identity its boresight is their +x and its rows run along −z. A `schedule`
    plans zoom, diffuser, energy and gate; a controller's commands take precedence over it.
    """

    preset: Text | None = Field(
        default=None,
        description=(
            "Name of a shipped camera, or path of a preset file (.toml), whose values apply where none are given here "
            "(docs/instrument.md, docs/camera_fit.md)."
        ),
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
    detector: AnyDetector = Field(default_factory=Gsfl, description="Detector: photons to range and intensity.")
    calibration: Calibration | None = Field(
        default=None, description="Origin of the constants of a detector that was fitted to measurements."
    )
    bounces: Annotated[Whole, Field(ge=1, le=16)] = Field(
        default=1,
        description=(
            "Number of surfaces that light may meet on its way. With 1, the laser alone lights each surface. With 2 or "
            "more, paths from the laser by two or more surfaces to the lens are added, with their own delay "
            "(docs/physics.md). `check` estimates what the second bounce adds."
        ),
    )
    schedule: Schedule | None = Field(
        default=None, description="Planned changes of the instrument's settings. If omitted, the settings are constant."
    )

    @model_validator(mode="before")
    @classmethod
    def _from_preset(cls, given: Any, info: ValidationInfo) -> Any:
        if not isinstance(given, dict):
            return given
        detector = given.get("detector")
        if isinstance(detector, dict) and "type" not in detector and "preset" not in given:
            given = {**given, "detector": {"type": "gsfl", **detector}}
        name = given.get("preset")
        if not isinstance(name, str):
            return given
        if name.lower().endswith(PRESET_SUFFIX):  # a recording must not need the file, so its values replace the name
            try:
                own = load_preset_file(name, (info.context or {}).get("folder"))
            except ScenarioError as error:
                raise ValueError(f"preset: {error}") from None
            merged = _merge_tables(own, {key: value for key, value in given.items() if key != "preset"})
            return _drop_stated(merged, set(_list_names(given.get("detector"))))
        if name not in load_presets():
            raise ValueError(
                f"preset: no camera '{name}'{did_you_mean(name, load_presets())} (known: {', '.join(load_presets())})"
            )
        return _merge_tables({key: value for key, value in load_presets()[name].items() if key != "what"}, given)

    @model_validator(mode="after")
    def _solve_threshold(self) -> Self:
        """Solve the threshold of a detector that states a condition for it, with its own pulse or the laser's."""
        detector: Any = self.detector
        condition, laser = getattr(detector, "solve", None), self.laser
        if not isinstance(condition, ThresholdCondition):
            return self
        if condition.pulse_fwhm_ns is not None:
            laser = Laser(pulse_fwhm_ns=condition.pulse_fwhm_ns)
        elif condition.pd is not None and laser.pulse_shape == "measured":
            raise ValueError(
                "detector.solve: the file of a measured pulse is not read yet; give pulse_fwhm_ns in solve"
            )
        step_s, power_per_s = Laser().pulse if laser.pulse_shape == "measured" else laser.pulse
        pulse = LaserPulse(step_s, power_per_s, laser.pulse_fwhm_ns * units.NS)
        self.__dict__["detector"] = solve_threshold(detector, pulse)
        return self

    @model_validator(mode="after")
    def _has_traits(self) -> Self:
        check_traits(self.detector)
        check_noise(self.detector)
        for name in self.detector.traits.settings:
            if name in (*_SETTINGS, _EXPOSURE):
                raise ValueError(f"detector: '{name}' among its settings is one of the lidar's; rename it")
        return self

    @model_validator(mode="after")
    def _can_be_hashed(self) -> Self:
        try:
            hash(self.detector)
        except TypeError:
            kind = type(self.detector).__name__
            raise ValueError(
                f"detector: objects of {kind} cannot be hashed; give the class __hash__, or a dataclass frozen=True"
            ) from None
        return self

    @model_validator(mode="after")
    def _gate_for_the_plan(self) -> Self:
        planned = self.schedule is not None and self.schedule.gate_delay_ns is not None
        if planned and not self.detector.traits.is_gated:
            raise ValueError("schedule.gate_delay_ns needs a gate; add [lidar.detector.gate]")
        return self

    @property
    def changes_lens(self) -> bool:
        """Whether the schedule changes the focal length, and so the pixels' lines of sight."""
        return self.schedule is not None and self.schedule.focal_length_mm is not None

    @property
    def pulse(self) -> LaserPulse:
        """The laser's pulse as the detector meets it."""
        return LaserPulse(*self.laser.pulse, self.laser.pulse_fwhm_s, self.laser.timing_jitter_ns)

    @property
    def exposure_s(self) -> float:
        """Time from the first to the last pulse of a frame [s]."""
        rate_hz = self.laser.pulse_rate_hz
        return 0.0 if rate_hz is None else (self.detector.traits.pulses - 1) / rate_hz

    @property
    def max_returns(self) -> int:
        """Number of returns of a pixel that are listed."""
        return self.detector.traits.max_returns

    @property
    def unstated_settings(self) -> list[str]:
        """Names of the detector's settings that a preset file has from assumed defaults of the package."""
        return [] if self.calibration is None else self.calibration.list_assumed(self.detector)

    def at(self, time_s: float, command: Command | None = None) -> Lidar:
        """Return the instrument with the settings in force at one time: those of the schedule, then those of a command.

        Parameters
        ----------
        time_s : time [s since start_utc]
        command : of a controller, or None

        Raises
        ------
        ScenarioError
            If a commanded setting is not allowed.
        """
        wanted = self.schedule.at(time_s) if self.schedule else {}
        with add_place("simulate: the controller's command" if command else "lidar.schedule"):
            wanted |= read_command(command) if command else {}
            return self.with_settings(wanted) if wanted else self

    def with_settings(self, settings: Mapping[str, float]) -> Lidar:
        """Return the instrument with other settings.

        Parameters
        ----------
        settings : values by the names of a `Schedule`, in their units
        """
        return _with_settings(self, tuple(settings.items()))

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed; a new preset replaces the values that came from the old one.

        Parameters
        ----------
        **changes : new values by the names of their fields, in the units of those names

        Raises
        ------
        ScenarioError
            If a name is unknown or a value is not allowed, and for a preset of a lidar whose detector was fitted: what its
            preset file stated cannot be told from what the scenario did.
        """
        new = changes.get("preset")
        if (
            new is not None
            and self.preset is None
            and self.calibration
            and not {"detector", "calibration"} <= set(changes)
        ):
            raise ScenarioError(
                f"lidar.preset: the values of the camera '{self.calibration.name}' took the place of its preset file, and "
                f"'{new}' would not replace them; make a new one: rl.Lidar(preset=..., laser=lidar.laser, "
                "receiver=lidar.receiver)"
            )
        if new is not None and self.preset is not None and new != self.preset:
            old = Lidar(preset=self.preset)  # type: ignore[call-arg]
            for name in ("laser", "receiver", "detector"):
                part, before = getattr(self, name), getattr(old, name)
                if name in changes or type(part) is not type(before):
                    continue
                kept = {key for key in part.model_fields_set if getattr(part, key) != getattr(before, key)}
                changes[name] = {key: getattr(part, key) for key in kept}
        return super().replace(**changes)

    @property
    def settings(self) -> dict[str, float]:
        """Settings in force, in SI, as every frame records them."""
        values = (
            self.laser.energy_mj * units.MJ,
            self.laser.divergence_rad,
            self.laser.wavelength_m,
            self.laser.pulse_fwhm_s,
            self.receiver.focal_length_m,
            self.receiver.aperture_m,
        )
        exposure = {_EXPOSURE: self.exposure_s} if self.exposure_s > 0.0 else {}
        return {**dict(zip(_SETTINGS, values, strict=True)), **exposure, **self.detector.traits.settings}


def _merge_tables(preset: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Merge the user's table into that of a preset, key by key; a part of another type replaces the preset's whole."""
    result = dict(preset)
    for part, name in list_determined(given):  # by the entries of a data sheet, or by a condition
        if part is None:
            result.pop(name, None)
        elif isinstance(result.get(part), Mapping):
            result[part] = {key: value for key, value in result[part].items() if key != name}
    for pair in _ALTERNATIVES:
        if pair & set(given):
            result = {key: value for key, value in result.items() if key not in pair}
    for key, value in given.items():
        old = result.get(key)
        mixes = isinstance(old, Mapping) and old.get("type") == _find_type(value, old)
        if mixes and isinstance(value, Part):
            value = {name: getattr(value, name) for name in value.model_fields_set}
        result[key] = _merge_tables(old, value) if mixes and isinstance(value, Mapping) else value  # type: ignore[arg-type]
    return result


def _list_names(table: Any, place: str = "") -> Iterator[str]:
    """Yield the dotted names of the settings that a table or a part states."""
    if isinstance(table, Part):
        table = {name: getattr(table, name) for name in table.model_fields_set}
    for name, value in table.items() if isinstance(table, Mapping) else ():
        yield f"{place}{name}"
        yield from _list_names(value, f"{place}{name}.")


def _drop_stated(lidar: dict[str, Any], stated: Set[str]) -> dict[str, Any]:
    """Leave out of a calibration's assumed settings those that the scenario states, in tables that are not checked yet."""
    calibration = lidar.get("calibration")
    if not isinstance(calibration, Mapping) or not isinstance(assumed := calibration.get("assumed"), list):
        return lidar
    left = [setting for setting in assumed if not isinstance(setting, Mapping) or setting.get("name") not in stated]
    return {**lidar, "calibration": {**calibration, "assumed": left}}


def _find_type(value: Any, old: Mapping[str, Any]) -> Any:
    """Return the type that a table or a part states, or else that of the preset."""
    if isinstance(value, Mapping):
        return value.get("type", old.get("type"))
    return getattr(value, "type", old.get("type"))


@lru_cache(maxsize=64)
def _with_settings(lidar: Lidar, wanted: tuple[tuple[str, float], ...]) -> Lidar:
    values = dict(wanted)
    changes: dict[str, Any] = {}
    light = {name: values[name] for name in ("divergence_deg", "energy_mj") if name in values}
    if light:
        changes["laser"] = lidar.laser.replace(**light)
    if "focal_length_mm" in values:
        changes["receiver"] = lidar.receiver.replace(fov_deg=None, focal_length_mm=values["focal_length_mm"])
    if "gate_delay_ns" in values:
        if not lidar.detector.traits.is_gated:
            raise ScenarioError("gate_delay_s: the detector has no gate; add [lidar.detector.gate]")
        gated: Any = lidar.detector
        changes["detector"] = gated.with_gate_delay(values["gate_delay_ns"])
    return lidar.replace(**changes)


def check_instrument(lidar: Lidar) -> None:
    """Read the files of an instrument, which must have been found, and refuse a detector that is too large.

    Raises
    ------
    ScenarioError
        For a file that cannot be read, and for a detector with too many pixels or samples.
    """
    lenses = {lidar.receiver}
    if lidar.schedule is not None and lidar.schedule.focal_length_mm is not None:
        ends = min(lidar.schedule.focal_length_mm), max(lidar.schedule.focal_length_mm)
        lenses |= {lidar.with_settings({"focal_length_mm": end}).receiver for end in ends}
    for receiver in lenses:
        read_files(lidar.laser, receiver)
    check_size(lidar.detector, lidar.laser.pulse_fwhm_s, lidar.receiver.n_rows * lidar.receiver.n_cols)
    check_maps(lidar.detector, (lidar.receiver.n_rows, lidar.receiver.n_cols))
