"""Constants of a detector that were solved or assumed for another instrument than the user's."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator
from typing import Any

from rso_lidar import units
from rso_lidar.detector.ranging.pulse import LaserPulse
from rso_lidar.detector.settings.gsfl import Gsfl
from rso_lidar.detector.settings.presets import DETECTOR_PRESETS, SOLVED_CONSTANTS
from rso_lidar.part import Part

# State for which `make calibrate` solved the constants of the presets.
_REFERENCE_PULSE_NS, _REFERENCE_WAVELENGTH_NM = 8.0, 1064.0
_WITHIN = 0.01  # relative difference that counts as none
_ASSUMED = re.compile(r"Default: (derived|assumed|solved|fitted|computed)|; assumed\b")


def describe_foreign_constants(
    detector: object, pulse: LaserPulse, wavelength_m: float, unstated: Collection[str] = ()
) -> list[str]:
    """Describe constants of a detector that were solved or stated for another instrument, and what differs here.

    Parameters
    ----------
    detector : a part, or an object that follows the protocol `Detector`
    pulse : the laser's pulse
    wavelength_m : of the laser [m]
    unstated : as `list_assumed_settings` takes it. Where it names any, the detector is that of another camera

    Returns
    -------
    list of str
        A line for the constants of a preset, one for assumed defaults, and one for a data sheet of another wavelength; none
        where nothing differs from the instrument for which the presets are solved.
    """
    if not isinstance(detector, Gsfl):
        return list(_describe_assumed(detector, unstated)) if unstated else []
    lines = []
    kept = [words for (part, key), words in SOLVED_CONSTANTS.items() if is_of_preset(detector, part, key)]
    apart = list(_list_differences(detector, pulse, wavelength_m))
    if kept and apart and detector.gate is None:
        verb = "is" if len(kept) == 1 else "are"
        lines.append(
            f"{' and '.join(kept)} of preset {detector.preset} {verb} solved for {', '.join(apart)}; state yours in "
            "data_sheet, or add solve = { pd = 0.95, photons = 1000 }"
        )
    if apart or unstated:
        lines += _describe_assumed(detector, unstated)
    laser_nm = wavelength_m / units.NM
    sheet_nm = laser_nm if detector.data_sheet is None else detector.data_sheet.wavelength_nm or laser_nm
    if not math.isclose(sheet_nm, laser_nm, rel_tol=_WITHIN):
        lines.append(
            f"responsivity and NEP of the data sheet hold at {sheet_nm:g} nm, and the laser has {laser_nm:g} nm; "
            "correct one of them"
        )
    return lines


def _describe_assumed(detector: object, unstated: Collection[str]) -> Iterator[str]:
    """Yield a line that names the assumed settings of a detector, if it has any."""
    if assumed := list_assumed_settings(detector, unstated):
        yield f"defaults of the package, not of a camera: {', '.join(assumed)}; state those of yours"


def is_of_preset(gsfl: Gsfl, part: str, key: str) -> bool:
    """Return whether a constant has the value of the detector's preset."""
    return bool(getattr(getattr(gsfl, part), key) == DETECTOR_PRESETS[gsfl.preset][key])


def _list_differences(gsfl: Gsfl, pulse: LaserPulse, wavelength_m: float) -> Iterator[str]:
    """Yield what the reference state has, and what is here instead."""
    reference = Gsfl()
    compared = (
        ("a pulse of {:.3g} ns, not {:.3g}", _REFERENCE_PULSE_NS, pulse.fwhm_s / units.NS),
        ("{:.4g} nm, not {:.4g}", _REFERENCE_WAVELENGTH_NM, wavelength_m / units.NM),
        ("QE {:.3g}, not {:.3g}", reference.quantum_efficiency, gsfl.quantum_efficiency),
        ("gain {:.3g}, not {:.3g}", reference.apd.gain, gsfl.apd.gain),
        ("k {:.3g}, not {:.3g}", reference.apd.ionisation_ratio, gsfl.apd.ionisation_ratio),
        ("{:.3g} nA, not {:.3g}", reference.apd.dark_current_na, gsfl.apd.dark_current_na),
        ("{:.3g} MHz, not {:.3g}", reference.amplifier.bandwidth_mhz, gsfl.amplifier.bandwidth_mhz),
    )
    for text, solved, here in compared:
        if not math.isclose(solved, here, rel_tol=_WITHIN):
            yield text.format(solved, here)


def list_assumed_settings(detector: object, unstated: Collection[str] = ()) -> list[str]:
    """List the settings of a detector that are left at a default which is assumed, solved or fitted, not sourced.

    Parameters
    ----------
    detector : a part; of any other object nothing is known
    unstated : names of settings whose values are such defaults although the detector states them, as that of a preset file
        does: ``lidar.unstated_settings``

    Returns
    -------
    list of str
        Places of the settings, such as ``apd.gain``.
    """
    if not isinstance(detector, Part):
        return []
    places = [*_iterate_assumed(detector, ""), *unstated]
    if isinstance(detector, Gsfl):
        places += [f"{part}.{key}" for part, key in SOLVED_CONSTANTS if is_of_preset(detector, part, key)]
        if detector.gate is not None:  # which has no trigger to arm
            places = [place for place in places if not place.startswith(("armed_", "trigger."))]
    return list(dict.fromkeys(places))


def _iterate_assumed(part: Part, path: str) -> Iterator[str]:
    """Yield the places of the settings in a part that are at an assumed default."""
    for name, field in type(part).model_fields.items():
        value: Any = getattr(part, name)
        if isinstance(value, Part):
            yield from _iterate_assumed(value, f"{path}{name}.")
        elif name not in part.model_fields_set and isinstance(value, float | int) and not isinstance(value, bool):
            yield from [f"{path}{name}"] if _ASSUMED.search(field.description or "") else []
