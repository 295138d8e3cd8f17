"""Facts about a detector of any kind that the rest of the package reads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import Literal

from rso_lidar.errors import ScenarioError


@dataclass(frozen=True)
class DetectorTraits:
    """The facts about a detector that a scenario, its description and the studies read.

    Parameters
    ----------
    sees_to_m : greatest range at which anything is detected [m]
    threshold_photons : photons of a return that is detected in about half of all flashes, if the detector does not lengthen
        the laser's pulse. `find_photons` counts the pulse
    sees_from_m : least range at which anything is detected [m]
    max_returns : how many returns of a pixel are listed
    returns : which return of a pixel is reported as its range and intensity
    stored_behind_m : depth behind the first return in which others are still seen [m]
    saturation_photons : photons of a return from which the intensity no longer rises, if the detector does not change the
        laser's pulse. `find_saturation_photons` counts the pulse
    clipped_range_photons : photons of a return from which clipping spoils the range, not only the intensity
    strong_return_cure : what a user may change in the detector for returns that clip, for advice; empty without a cure
    settings : values in force that every frame records, by name, in SI, such as ``gate_delay_s``
    has_waveforms : whether `detect` returns Waveforms
    has_taps : whether the signals between its stages can be kept
    is_gated : whether it sees a short window that a plan or a controller moves. Such a detector has a method
        ``with_gate_delay(delay_ns)`` that returns a copy whose window opens that long after emission
    window_keys : settings of the detector that place its window, for advice, such as ``"armed_from_m and armed_to_m"``
    pulses : laser pulses that one frame averages
    clock_s : time between samples or bins [s]. Trials move their returns evenly over it
    samples : samples that a pixel stores of a pulse. Trials of a detector are fewer where these are many
    """

    sees_to_m: float
    threshold_photons: float
    sees_from_m: float = 0.0
    max_returns: int = 1
    returns: Literal["first", "strongest", "last"] = "first"
    stored_behind_m: float = math.inf
    saturation_photons: float = math.inf
    clipped_range_photons: float = math.inf
    strong_return_cure: str = ""
    settings: Mapping[str, float] = field(default_factory=dict, hash=False)
    has_waveforms: bool = False
    has_taps: bool = False
    is_gated: bool = False
    window_keys: str = ""
    clock_s: float = 0.0
    pulses: int = 1
    samples: int = 1

    def __post_init__(self) -> None:
        """Raise `ScenarioError` that names the first fact that no detector can have."""
        for name, least in (
            ("sees_from_m", 0.0),
            ("threshold_photons", 0.0),
            ("stored_behind_m", 0.0),
            ("saturation_photons", 0.0),
            ("clipped_range_photons", 0.0),
            ("clock_s", 0.0),
        ):
            value = getattr(self, name)
            if not isinstance(value, Real) or not float(value) >= least:
                raise ScenarioError(f"DetectorTraits.{name}: {value!r:.40} is not a number from {least:g}; correct it")
        if not isinstance(self.sees_to_m, Real) or not float(self.sees_to_m) > self.sees_from_m:
            raise ScenarioError(
                f"DetectorTraits.sees_to_m: {self.sees_to_m!r:.40} is not beyond sees_from_m ({self.sees_from_m:g}); "
                "correct it"
            )
        for name in ("max_returns", "pulses", "samples"):
            value = getattr(self, name)
            if not isinstance(value, Integral) or isinstance(value, bool) or value < 1:
                raise ScenarioError(f"DetectorTraits.{name}: {value!r:.40} is not a whole number from 1; correct it")
        kinds = {
            "has_waveforms": bool,
            "has_taps": bool,
            "is_gated": bool,
            "window_keys": str,
            "strong_return_cure": str,
        }
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name), kind):
                what = "True or False" if kind is bool else "a text"
                raise ScenarioError(f"DetectorTraits.{name}: {getattr(self, name)!r:.40} is not {what}; correct it")
        if self.returns not in ("first", "strongest", "last"):
            raise ScenarioError(
                f"DetectorTraits.returns: {self.returns!r:.40} is none of first, strongest, last; choose one"
            )
        if not isinstance(self.settings, Mapping) or not all(
            isinstance(name, str) and name.isidentifier() and isinstance(value, Real) and math.isfinite(value)
            for name, value in self.settings.items()
        ):
            raise ScenarioError(
                "DetectorTraits.settings: needs finite numbers by name, such as {'gate_delay_s': 1e-6}; correct it"
            )
