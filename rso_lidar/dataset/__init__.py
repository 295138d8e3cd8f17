"""Datasets for learning: many samples of a scenario drawn by laws, flown, labelled and written in shards."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.dataset import torch
    from rso_lidar.dataset.annotation.frame_labels import FrameLabels, label_frame
    from rso_lidar.dataset.checking.folder_check import check_folder
    from rso_lidar.dataset.checking.spec_check import check_spec
    from rso_lidar.dataset.conversion.dataset_export import EXPORT_FORMATS
    from rso_lidar.dataset.conversion.dataset_export import export_dataset as export
    from rso_lidar.dataset.making.make import make
    from rso_lidar.dataset.publication.publish import publish
    from rso_lidar.dataset.reading.random_access import Dataset, Split
    from rso_lidar.dataset.reading.random_access import open_dataset as open
    from rso_lidar.dataset.scoring.comparison import Comparison, compare
    from rso_lidar.dataset.scoring.folder_scores import score
    from rso_lidar.dataset.scoring.report import (
        check_score_report,
        format_comparison,
        format_scores,
        save_score_report,
    )
    from rso_lidar.dataset.scoring.scorecard import Scorecard
    from rso_lidar.dataset.specification.distributions import (
        Choice,
        LogUniform,
        Normal,
        PowerLaw,
        Shell,
        Uniform,
        UniformDirection,
        UniformRotation,
        WholeNumber,
    )
    from rso_lidar.dataset.specification.spec import DatasetSpec
    from rso_lidar.dataset.specification.tables import (
        ClassOfTargets,
        Clutter,
        DrawnField,
        DrawnFragments,
        FrameSequence,
        ModelSplit,
        OptionalLabels,
        RandomSplit,
        RandomView,
        ReferencePointing,
        SensorEntry,
        SensorSplit,
        TaxonomyFilter,
    )
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "EXPORT_FORMATS",
    "Choice",
    "ClassOfTargets",
    "Clutter",
    "Comparison",
    "Dataset",
    "DatasetSpec",
    "DrawnField",
    "DrawnFragments",
    "FrameLabels",
    "FrameSequence",
    "LogUniform",
    "ModelSplit",
    "Normal",
    "OptionalLabels",
    "PowerLaw",
    "RandomSplit",
    "RandomView",
    "ReferencePointing",
    "Scorecard",
    "SensorEntry",
    "SensorSplit",
    "Shell",
    "Split",
    "TaxonomyFilter",
    "Uniform",
    "UniformDirection",
    "UniformRotation",
    "WholeNumber",
    "check_folder",
    "check_score_report",
    "check_spec",
    "compare",
    "export",
    "format_comparison",
    "format_scores",
    "label_frame",
    "make",
    "open",
    "publish",
    "save_score_report",
    "score",
    "torch",
]

__dir__ = limit_dir(__name__)
