"""Every number that a user writes ends in its unit, or is known to need none."""

import importlib
import types
from pathlib import Path
from typing import Annotated, Union, get_args, get_origin

from rso_lidar.part import Part

ROOT = Path(__file__).resolve().parents[2]
UNITS = """
    m km s ns rad deg m_s m_s2 deg_s deg_s2 rev_day rev_day2 rev_day3 kg m2 n per_earth_radius hz mhz nm um mm mj kg
    kg_m2 n_m na nf ohm per_v per_sr per_s counts photons electrons fraction
"""
SUFFIXES = tuple(f"_{unit}" for unit in UNITS.split())
NO_SUFFIX = {  # name: why it needs none
    "absolute_tolerance": "in the units of the state",
    "adc_bits": "a number of bits",
    "axis": "a direction, of any length",
    "pattern": "a number that only names one of many alike",
    "camera_seed": "a number that only names a camera",
    "coefficient": "a ratio",
    "count": "a number of values",
    "counts_per_photon": "a ratio whose name says both units",
    "damping": "share of critical damping",
    "degree": "of a polynomial",
    "diffuse": "share of the light",
    "drag_coefficient": "a ratio",
    "eccentricity": "a ratio of lengths",
    "electrons_per_count": "a ratio whose name says both units",
    "excess_noise_factor": "a ratio of variances",
    "exponent": "a power",
    "f_number": "a ratio of lengths, and everybody's word for it",
    "false_alarm_probability": "a probability",
    "fraction": "share of a pulse's peak",
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
    "left_out": "numbers of facets",
    "loops": "a number of loops",
    "low": "in the unit of the field that it is of",
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
    "specular": "share of the light",
    "steps_per_sample": "a number of steps",
    "sun_direction": "a direction, of any length",
    "transmission": "share of the light",
    "up": "a direction, of any length",
    "up_axis": "a direction, of any length",
    "zonal_degree": "of a harmonic",
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


PARTS = parts()
NUMBERS = [(cls, name) for cls in PARTS for name, field in cls.model_fields.items() if numeric(field.annotation)]


def test_there_are_parts_with_numbers():
    assert len(PARTS) > 100
    assert len(NUMBERS) > 300


def test_numbers_end_in_their_unit():
    bare = [f"{cls.__name__}.{name}" for cls, name in NUMBERS if not name.endswith(SUFFIXES) and name not in NO_SUFFIX]
    assert not bare


def test_no_reason_is_given_for_a_name_that_is_gone():
    assert set(NO_SUFFIX) <= {name for _, name in NUMBERS}


def test_parts_have_prose_and_keep_the_rules():
    rules = {"frozen": True, "extra": "forbid", "allow_inf_nan": False}
    assert not [cls.__name__ for cls in PARTS if not cls.__doc__]
    assert not [cls.__name__ for cls in PARTS if not rules.items() <= dict(cls.model_config).items()]
