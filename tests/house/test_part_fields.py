"""Every field of a part says what it means, and every number in which unit."""

import importlib
import re
import types
from pathlib import Path
from typing import Annotated, Union, get_args, get_origin

from rso_lidar.part import Part
from rso_lidar.scenario import Scenario

ROOT = Path(__file__).resolve().parents[2]
UNITS = {  # how a name ends, and what its description says in brackets
    "m": "m", "km": "km", "mm": "mm", "um": "µm", "nm": "nm", "s": "s", "ms": "ms", "us": "µs", "ns": "ns",
    "deg": "deg", "rad": "rad",
    "j": "J", "mj": "mJ", "m_s": "m/s", "m_s2": "m/s²", "deg_s": "deg/s", "deg_s2": "deg/s²", "hz": "Hz", "mhz": "MHz",
    "kg": "kg", "kg_m2": "kg m²", "m2": "m²", "n": "N", "per_s": "1/s", "per_sr": "1/sr", "per_v": "1/V", "na": "nA",
    "nf": "nF", "ohm": "Ω", "counts": "counts", "photons": "photons", "electrons": "electrons", "rev_day": "rev/day",
    "deg_sqrt_h": "deg/√h", "deg_h": "deg/h", "deg_h_sqrt_h": "deg/h/√h", "m_s_sqrt_h": "m/s/√h", "ug": "µg",
    "m_s2_sqrt_hz": "m/s²/√Hz", "a_per_w": "A/W", "pa_per_sqrt_hz": "pA/√Hz", "w_per_sqrt_hz": "W/√Hz",
    "ug_sqrt_h": "µg/√h", "g": "g", "ppm": "ppm", "mrad": "mrad", "arcsec": "arcsec", "rpm": "rpm", "n_m": "N m",
    "rev_day2": "rev/day²", "rev_day3": "rev/day³", "days": "day", "pixels": "pixels",
    "per_earth_radius": "1/R⊕", "db": "dB", "fraction": None,
}  # fmt: skip
SUFFIXES = tuple(f"_{unit}" for unit in UNITS)
NO_SUFFIX = {  # name: why it needs none
    "absorbed": "a share",
    "accommodation": "a share",
    "cross_covariance": "metres and seconds, by row and column",
    "equals": "in the unit of its quantity",
    "initial": "in the unit of the field that it is of",
    "matrix": "metres and seconds, by row and column",
    "max_iterations": "a number of iterations",
    "reradiated": "a share",
    "speed_ratio": "of two speeds",
    "tolerance": "in the unit of its quantity",
    "wall_temperature_ratio": "of two temperatures",
    "bits": "a number of bits",
    "intensity_bits": "a number of bits",
    "no_return_word": "a word, in steps of the quantum",
    "range_bits": "a number of bits",
    "p_value": "a probability",
    "photons": "in the unit that photons_per_unit states",
    "photons_per_unit": "a ratio, to the unit of the column",
    "systematic": "in the unit of the column",
    "scatter": "in the unit of the column",
    "counts_per_unit": "a ratio, to the unit of the column",
    "threshold": "in the unit that electrons_per_unit states",
    "trials": "a number of trials, or a time of several pixels",
    "value": "in the unit of the field that it is of",
    "covariance": "metres and seconds, by row and column",
    "flashes": "a number of flashes",
    "fold": "a number of steps in a turn",
    "half_turn": "a direction, of any length",
    "needed": "a number of flashes",
    "pixels": "a number of pixels",
    "pd": "a probability, and everybody's word for it",
    "absolute_tolerance": "in the units of the state",
    "adc_bits": "a number of bits",
    "afterpulse_probability": "a probability",
    "axis": "a direction, of any length",
    "direction": "a direction, of any length",
    "ratio": "of two gains",
    "pattern": "a number that only names one of many alike",
    "camera_seed": "a number that only names a camera",
    "pattern_seed": "a number that only names a camera",
    "chi2": "a sum of squared residuals",
    "coefficient": "a ratio",
    "corridor_axis": "a direction, of any length",
    "count": "a number of values",
    "counts_per_photon": "a ratio whose name says both units",
    "damping": "share of critical damping",
    "degree": "of a polynomial",
    "density": "a logarithm of a ratio",
    "detection_efficiency": "a probability",
    "diffuse": "share of the light",
    "drag_coefficient": "a ratio",
    "earth_albedo": "share of the light",
    "eccentricity": "a ratio of lengths",
    "electrons_per_count": "a ratio whose name says both units",
    "electrons_per_unit": "a ratio, to the unit of the column",
    "excess_noise_factor": "a ratio of variances",
    "exponent": "a power",
    "f_number": "a ratio of lengths, and everybody's word for it",
    "false_alarm_probability": "a probability",
    "fraction": "share of a pulse's peak",
    "freedom": "a number of degrees of freedom",
    "further_state": "each entry has its own unit",
    "frame": "a number of a frame",
    "gain": "electrons for an electron",
    "high": "in the unit of the field that it is of",
    "hops": "a number of hops",
    "initial_state": "each entry has its own unit, that of the user's dynamics",
    "inputs": "each entry has its own unit",
    "intensity_excess_noise_factor": "a ratio of variances",
    "ionisation_ratio": "a ratio of rates",
    "k1": "a coefficient of pure numbers",
    "k2": "a coefficient of pure numbers",
    "k3": "a coefficient of pure numbers",
    "knee_sine": "the sine of an angle",
    "left_out": "numbers of facets",
    "loops": "a number of loops",
    "low": "in the unit of the field that it is of",
    "bounces": "a number of surfaces",
    "max_returns": "a number of returns",
    "min_rays_per_target": "a number of rays",
    "n_cols": "a number of pixels",
    "n_rows": "a number of pixels",
    "norad_id": "a catalogue number",
    "normal": "a direction, of any length",
    "p1": "a coefficient of pure numbers",
    "p2": "a coefficient of pure numbers",
    "pictures": "a number of pictures",
    "points": "a number of points",
    "pretrigger_samples": "a number of samples",
    "pulse_order": "a power",
    "pulses": "a number of pulses",
    "quantum_efficiency": "share of the photons",
    "quaternion_xyzw": "a unit quaternion, in the order that it ends in",
    "range_excess_noise_factor": "a ratio of variances",
    "rays_per_pixel": "a number of rays",
    "sampling_error": "a ratio",
    "reference_photons": "photons, as its first word says",
    "reflectance": "share of the light",
    "refractive_index": "a ratio of speeds",
    "relative_tolerance": "a ratio",
    "revolutions": "a number of revolutions",
    "roughness": "a ratio of lengths",
    "samples": "a number of samples",
    "scale": "a ratio of lengths",
    "seeds": "a number of seeds",
    "seed": "a number that only names a stream of noise",
    "slope": "a power",
    "specular": "share of the light",
    "steps_per_sample": "a number of steps",
    "sun_direction": "a direction, of any length",
    "surfaces": "a number of surfaces",
    "transmission": "share of the light",
    "up": "a direction, of any length",
    "up_axis": "a direction, of any length",
    "alpha": "share of each new angle",
    "draws": "a number of draws",
    "frames": "a number of frames",
    "mean": "in the unit of the field that it is of",
    "min_pixels": "a number of pixels",
    "shard_frames": "a number of frames",
    "sigma": "in the unit of the field that it is of",
    "start": "the number of a frame",
    "stride": "a number of frames",
    "test": "share of the samples",
    "val": "share of the samples",
    "weights": "ratios",
    "speed_entries": "numbers of entries",
    "torque_entries": "numbers of entries",
    "force_entries": "numbers of entries",
    "newtons_per_input": "a ratio whose name says its unit",
    "vertical_ratio": "of two errors",
    "zonal_degree": "of a harmonic",
    "ap": "a geomagnetic index",
    "f107": "solar flux units, said in its text",
    "f107a": "solar flux units, said in its text",
    "order": "of a harmonic",
    "at_least": "in the unit of the quantity that it bounds",
    "at_most": "in the unit of the quantity that it bounds",
    "within": "in the unit of the quantity that it bounds",
    "confidence": "a probability",
    "probability": "a probability",
    "drop_probability": "a probability",
    "sequence": "the number of a request",
}


def parts():
    """Return every part class there is, in whatever room it lives."""
    for file in sorted((ROOT / "rso_lidar").rglob("*.py")):
        words = file.relative_to(ROOT).with_suffix("").parts
        if words[-1] not in ("__init__", "__main__"):
            importlib.import_module(".".join(words))
    found, waiting = set(), [Part]
    while waiting:
        waiting += (below := waiting.pop().__subclasses__())
        found.update(below)
    return sorted((cls for cls in found if cls.__module__.startswith("rso_lidar")), key=lambda cls: cls.__qualname__)


def numeric(annotation):
    """Return whether a number can stand in a field, on its own or in a list."""
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return issubclass(annotation, int | float) and annotation is not bool
    if get_origin(annotation) is Annotated:
        return numeric(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType, tuple, list):
        return any(numeric(inner) for inner in get_args(annotation))
    return False


def unit(name):
    """Return the unit that a name ends in, by its longest ending; nothing where it needs none."""
    words = name.split("_")
    endings = ("_".join(words[k:]) for k in range(1, len(words)))
    return next((UNITS[ending] for ending in endings if ending in UNITS), None)


PARTS = parts()
FIELDS = [(f"{cls.__name__}.{name}", field) for cls in PARTS for name, field in cls.model_fields.items()]
NUMBERS = [(cls, name) for cls in PARTS for name, field in cls.model_fields.items() if numeric(field.annotation)]


def test_there_are_parts_with_numbers():
    assert len(PARTS) > 100
    assert len(NUMBERS) > 300


def test_every_field_says_its_meaning_in_sentences():
    sentence = re.compile(r"[A-Z0-9`].*\.", re.DOTALL)
    silent = [name for name, field in FIELDS if not sentence.fullmatch(field.description or "")]
    assert len(FIELDS) > 500 and not silent


def test_a_number_with_a_unit_in_its_name_has_it_in_its_meaning():
    wanted = {
        f"{cls.__name__}.{name}": (f"[{unit(name)}]", cls.model_fields[name].description)
        for cls, name in NUMBERS
        if unit(name) and name not in NO_SUFFIX
    }
    assert len(wanted) > 200
    assert not {name: told for name, (told, description) in wanted.items() if told not in description}


def test_the_schema_describes_every_property():
    schema = Scenario.model_json_schema()
    tables = {"Scenario": schema} | schema["$defs"]
    properties = {f"{name}.{key}": it for name, table in tables.items() for key, it in table["properties"].items()}
    assert len(properties) > 500
    assert not [name for name, it in properties.items() if not it.get("description")]


def test_numbers_end_in_their_unit():
    bare = [f"{cls.__name__}.{name}" for cls, name in NUMBERS if not name.endswith(SUFFIXES) and name not in NO_SUFFIX]
    assert not bare


def test_no_reason_is_given_for_a_name_that_is_gone():
    assert set(NO_SUFFIX) <= {name for _, name in NUMBERS}


def test_parts_have_prose_and_keep_the_rules():
    rules = {"frozen": True, "extra": "forbid", "allow_inf_nan": False}
    assert not [cls.__name__ for cls in PARTS if not cls.__doc__]
    assert not [cls.__name__ for cls in PARTS if not rules.items() <= dict(cls.model_config).items()]
