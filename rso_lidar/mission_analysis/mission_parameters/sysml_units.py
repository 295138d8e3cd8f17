"""Units of parameters in SysML v2: quantity types of ISQ, and measurement units of SI.

Units that the library SI of SysML v2 (release 2026-06, `SI.sysml`) lacks are declared with a prefix or a factor, as it
declares its own. Counts of pixels, photons or electrons, and levels in dB, have the dimension one; their unit stands in the
documentation.
"""

from __future__ import annotations

import re
from typing import NamedTuple


class UnitNotation(NamedTuple):
    """Notation of a unit in SysML v2: quantity type, and expression of the unit, empty for the dimension one."""

    type: str
    unit: str


UNITS = {
    "1": UnitNotation("Real", ""),
    "dB": UnitNotation("Real", ""),
    "m": UnitNotation("LengthValue", "m"),
    "km": UnitNotation("LengthValue", "km"),
    "mm": UnitNotation("LengthValue", "mm"),
    "µm": UnitNotation("LengthValue", "'µm'"),
    "nm": UnitNotation("LengthValue", "nm"),
    "m²": UnitNotation("AreaValue", "m^2"),
    "s": UnitNotation("DurationValue", "s"),
    "day": UnitNotation("DurationValue", "d"),
    "ns": UnitNotation("DurationValue", "ns"),
    "µs": UnitNotation("DurationValue", "'µs'"),
    "ms": UnitNotation("DurationValue", "ms"),
    "Hz": UnitNotation("FrequencyValue", "Hz"),
    "MHz": UnitNotation("FrequencyValue", "MHz"),
    "1/s": UnitNotation("FrequencyValue", "s^-1"),
    "deg": UnitNotation("AngularMeasureValue", "'°'"),
    "rad": UnitNotation("AngularMeasureValue", "rad"),
    "mrad": UnitNotation("AngularMeasureValue", "mrad"),
    "arcsec": UnitNotation("AngularMeasureValue", "'″'"),
    "deg/h": UnitNotation("AngularVelocityValue", "'°'/h"),
    "deg/s": UnitNotation("AngularVelocityValue", "'°'/s"),
    "rad/s": UnitNotation("AngularVelocityValue", "rad/s"),
    "deg/s²": UnitNotation("AngularAccelerationValue", "'°'/s^2"),
    "rad/s²": UnitNotation("AngularAccelerationValue", "rad/s^2"),
    "deg/√h": UnitNotation("ScalarQuantityValue", "'°'/h^0.5"),
    "deg/h/√h": UnitNotation("ScalarQuantityValue", "'°'/h^1.5"),
    "m/s": UnitNotation("SpeedValue", "m/s"),
    "m/s/√h": UnitNotation("ScalarQuantityValue", "m/s/h^0.5"),
    "m/s²": UnitNotation("AccelerationValue", "m/s^2"),
    "m/s²/√Hz": UnitNotation("ScalarQuantityValue", "m/s^2/Hz^0.5"),
    "g": UnitNotation("AccelerationValue", "gn"),
    "µg": UnitNotation("AccelerationValue", "'µgn'"),
    "µg/√h": UnitNotation("ScalarQuantityValue", "'µgn'/h^0.5"),
    "ppm": UnitNotation("DimensionOneValue", "ppm"),
    "kg": UnitNotation("MassValue", "kg"),
    "kg m²": UnitNotation("MomentOfInertiaValue", "kg*m^2"),
    "N": UnitNotation("ForceValue", "N"),
    "N m": UnitNotation("TorqueValue", "N*m"),
    "J": UnitNotation("EnergyValue", "J"),
    "mJ": UnitNotation("EnergyValue", "mJ"),
    "nA": UnitNotation("ElectricCurrentValue", "nA"),
    "nF": UnitNotation("CapacitanceValue", "nF"),
    "A/W": UnitNotation("ScalarQuantityValue", "A/W"),
    "A/√Hz": UnitNotation("ScalarQuantityValue", "A/Hz^0.5"),
    "pA/√Hz": UnitNotation("ScalarQuantityValue", "pA/Hz^0.5"),
    "W/√Hz": UnitNotation("ScalarQuantityValue", "W/Hz^0.5"),
    "Ω": UnitNotation("ResistanceValue", "'Ω'"),
    "1/V": UnitNotation("ScalarQuantityValue", "V^-1"),
    "1/sr": UnitNotation("ScalarQuantityValue", "sr^-1"),
    "rpm": UnitNotation("ScalarQuantityValue", "min^-1"),
    "rev/day": UnitNotation("ScalarQuantityValue", "d^-1"),
    "rev/day²": UnitNotation("ScalarQuantityValue", "d^-2"),
    "rev/day³": UnitNotation("ScalarQuantityValue", "d^-3"),
}

# Units that SI.sysml lacks: name, type, and conversion by a prefix or a factor from another unit.
_PREFIXED = {
    "mJ": ("millijoule", "EnergyUnit", "milli", "J"),
    "ns": ("nanosecond", "DurationUnit", "nano", "s"),
    "'µs'": ("microsecond", "DurationUnit", "micro", "s"),
    "ms": ("millisecond", "DurationUnit", "milli", "s"),
    "'µm'": ("micrometre", "LengthUnit", "micro", "m"),
    "mrad": ("milliradian", "AngularMeasureUnit", "milli", "rad"),
    "MHz": ("megahertz", "FrequencyUnit", "mega", "Hz"),
    "nA": ("nanoampere", "ElectricCurrentUnit", "nano", "A"),
    "pA": ("picoampere", "ElectricCurrentUnit", "pico", "A"),
    "nF": ("nanofarad", "CapacitanceUnit", "nano", "F"),
    "'µgn'": ("'micro standard acceleration of free fall'", "AccelerationUnit", "micro", "gn"),
}
_CONVERTED = {
    # 3rd CGPM (1901), exact; `g` is the gram of SI.sysml
    "gn": ("'standard acceleration of free fall'", "AccelerationUnit", "9.80665", "m/s^2"),
    "ppm": ("'part per million'", "DimensionOneUnit", "1.0E-6", "one"),
}


def find_notation(unit: str) -> UnitNotation:
    """Return the notation of a unit; a real number without unit where SysML has none for it, such as photons."""
    return UNITS.get(unit, UNITS["1"])


def declare_units(units: set[str]) -> list[str]:
    """Return the declarations of those units that the library SI lacks, in a fixed order.

    Parameters
    ----------
    units : expressions of the units that a text uses
    """
    symbols = {symbol for unit in units for symbol in re.findall(r"'[^']+'|[A-Za-z]+", unit)}
    symbols |= {_PREFIXED[symbol][3] for symbol in symbols & set(_PREFIXED)}
    conversions = {
        short: (name, kind, f"ConversionByConvention {{ :>> referenceUnit = {of}; :>> conversionFactor = {factor}; }}")
        for short, (name, kind, factor, of) in _CONVERTED.items()
    } | {
        short: (name, kind, f"ConversionByPrefix {{ :>> prefix = {prefix}; :>> referenceUnit = {of}; }}")
        for short, (name, kind, prefix, of) in _PREFIXED.items()
    }
    return [
        f"attribute <{short}> {name} : {kind} {{ :>> unitConversion : {conversion} }}"
        for short, (name, kind, conversion) in conversions.items()
        if short in symbols
    ]
