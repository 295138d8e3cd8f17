"""The records that the stages of the walk hand on: frozen, SI, read-only.

Each array field states its dimensions, dtype, unit and meaning once, in `array(...)`. The checks, the attributes in files,
the tables in the docs and the labels on screen are made from that statement. Absence: no hit, no row in `Hits`; no return,
NaN in a range and 0 in an intensity; sky in an integer label is -1.
"""

from rso_lidar.public_names import limit_dir
from rso_lidar.records.frame import SCHEMA_VERSION, Command, Frame, Observation, Source, TargetEntry
from rso_lidar.records.light import Extent, Hits, Oversampled, Photons, Rays
from rso_lidar.records.reading import Labels, Reading, Taps, Waveforms
from rso_lidar.records.schema import ArraySpec, Record, array, specs
from rso_lidar.records.truth import BodyState, PtuAngles, Truth

__all__ = [
    "SCHEMA_VERSION",
    "ArraySpec",
    "BodyState",
    "Command",
    "Extent",
    "Frame",
    "Hits",
    "Labels",
    "Observation",
    "Oversampled",
    "Photons",
    "PtuAngles",
    "Rays",
    "Reading",
    "Record",
    "Source",
    "Taps",
    "TargetEntry",
    "Truth",
    "Waveforms",
    "array",
    "specs",
]

__dir__ = limit_dir(__name__)
