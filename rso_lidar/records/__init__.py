"""The records that the stages of a simulation pass on: frozen, SI, read-only.

Each array field states its dimensions, dtype, unit and meaning once, in `array(...)`. Checks, attributes in files, tables in
the docs and labels on screen are generated from that statement. A ray without a hit has no row in `Hits`. A pixel without a
return has NaN in ranges and 0 in intensities. Sky is -1 in an integer label.
"""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.records.frame import SCHEMA_VERSION, Command, Frame, Observation, Source, TargetEntry
    from rso_lidar.records.light import Bounces, Contours, Extent, Hits, Oversampled, Photons, Rays, Sky
    from rso_lidar.records.reading import Labels, PixelPrediction, Reading, Taps, Waveforms
    from rso_lidar.records.schema import ArraySpec, Record, array, specs
    from rso_lidar.records.symmetry import Symmetry, rotation_error_rad
    from rso_lidar.records.taxonomy import Taxonomy
    from rso_lidar.records.telemetry import (
        AccelerometerSamples,
        BodyMotion,
        GnssSamples,
        GyroSamples,
        RelativeGnssSamples,
        SensorSamples,
        SensorState,
        StarTrackerSamples,
        ThrusterSamples,
        WheelSamples,
        join_samples,
    )
    from rso_lidar.records.truth import BodyState, PtuAngles, Truth

__all__ = [
    "SCHEMA_VERSION",
    "AccelerometerSamples",
    "ArraySpec",
    "BodyMotion",
    "BodyState",
    "Bounces",
    "Command",
    "Contours",
    "Extent",
    "Frame",
    "GnssSamples",
    "GyroSamples",
    "Hits",
    "Labels",
    "Observation",
    "Oversampled",
    "Photons",
    "PixelPrediction",
    "PtuAngles",
    "Rays",
    "Reading",
    "Record",
    "RelativeGnssSamples",
    "SensorSamples",
    "SensorState",
    "Sky",
    "Source",
    "StarTrackerSamples",
    "Symmetry",
    "Taps",
    "TargetEntry",
    "Taxonomy",
    "ThrusterSamples",
    "Truth",
    "Waveforms",
    "WheelSamples",
    "array",
    "join_samples",
    "rotation_error_rad",
    "specs",
]

__getattr__ = export_lazily(__name__)
__dir__ = limit_dir(__name__)
