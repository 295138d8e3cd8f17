"""The records that the stages of a simulation pass on: frozen, SI, read-only.

Each array field states its dimensions, dtype, unit and meaning once, in `array(...)`. Checks, attributes in files, tables in
the docs and labels on screen are generated from that statement. A ray without a hit has no row in `Hits`. A pixel without a
return has NaN in ranges and 0 in intensities. Sky is -1 in an integer label.
"""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.records.boxes import LabelBox, find_box, find_boxes
    from rso_lidar.records.facet_table import FacetTable, grid_directions
    from rso_lidar.records.frame import SCHEMA_VERSION, Command, Frame, Observation, Source, TargetEntry
    from rso_lidar.records.image import CameraImage, CameraLabels
    from rso_lidar.records.light import Bounces, Contours, Extent, Hits, Oversampled, Photons, Rays, Sky
    from rso_lidar.records.part_classes import OTHER, PART_CLASSES, PartClass
    from rso_lidar.records.reading import Labels, PixelPrediction, Reading, Taps, Waveforms
    from rso_lidar.records.schema import ArraySpec, Record, array, specs
    from rso_lidar.records.symmetry import Symmetry, rotation_error_rad
    from rso_lidar.records.taxonomy import (
        FRAGMENT_LENGTHS_M,
        FragmentKind,
        Hinge,
        Keypoint,
        ObjectClass,
        ShapeFamily,
        SizeClass,
        Stabilisation,
        Taxonomy,
        classify_size,
    )
    from rso_lidar.records.telemetry import (
        AccelerometerSamples,
        BodyMotion,
        GnssSamples,
        GyroSamples,
        MotionQuantity,
        RelativeGnssSamples,
        SensorSamples,
        SensorState,
        StarTrackerSamples,
        ThrusterSamples,
        WheelSamples,
        join_samples,
    )
    from rso_lidar.records.truth import BodyState, PtuAngles, Truth
    from rso_lidar.records.viewing_geometry import (
        ViewingGeometry,
        compute_viewing_geometry,
        find_shadow_spans_s,
        tabulate_truth,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "FRAGMENT_LENGTHS_M",
    "OTHER",
    "PART_CLASSES",
    "SCHEMA_VERSION",
    "AccelerometerSamples",
    "ArraySpec",
    "BodyMotion",
    "BodyState",
    "Bounces",
    "CameraImage",
    "CameraLabels",
    "Command",
    "Contours",
    "Extent",
    "FacetTable",
    "FragmentKind",
    "Frame",
    "GnssSamples",
    "GyroSamples",
    "Hinge",
    "Hits",
    "Keypoint",
    "LabelBox",
    "Labels",
    "MotionQuantity",
    "ObjectClass",
    "Observation",
    "Oversampled",
    "PartClass",
    "Photons",
    "PixelPrediction",
    "PtuAngles",
    "Rays",
    "Reading",
    "Record",
    "RelativeGnssSamples",
    "SensorSamples",
    "SensorState",
    "ShapeFamily",
    "SizeClass",
    "Sky",
    "Source",
    "Stabilisation",
    "StarTrackerSamples",
    "Symmetry",
    "Taps",
    "TargetEntry",
    "Taxonomy",
    "ThrusterSamples",
    "Truth",
    "ViewingGeometry",
    "Waveforms",
    "WheelSamples",
    "array",
    "classify_size",
    "compute_viewing_geometry",
    "find_box",
    "find_boxes",
    "find_shadow_spans_s",
    "grid_directions",
    "join_samples",
    "rotation_error_rad",
    "specs",
    "tabulate_truth",
]

__dir__ = limit_dir(__name__)
