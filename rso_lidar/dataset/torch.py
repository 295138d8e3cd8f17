"""Datasets for PyTorch: a map-style dataset, its order, its collation, transforms and augmentation.

::

    import torch
    import rso_lidar as rl
    from rso_lidar.dataset.torch import CropReturns, FrameDataset, FrameSampler, RedrawNoise, to_tensors

    data = rl.dataset.open("seven")
    frames = FrameDataset(data.split("train"), ("class_id",), augmentations=[RedrawNoise()], transforms=[CropReturns()])
    order = FrameSampler(frames.split)
    loader = torch.utils.data.DataLoader(frames, 64, sampler=order, num_workers=2, collate_fn=to_tensors)

Only `to_tensors` imports PyTorch, when it is called. Everything else works with any data loader.
"""

from rso_lidar.dataset.training.augmentation import LowerEnergy, MirrorImages, QuarterTurns, RedrawNoise
from rso_lidar.dataset.training.frame_dataset import Augmentation, FrameDataset, Transform, stack_frames, to_tensors
from rso_lidar.dataset.training.order import FrameSampler, Visit
from rso_lidar.dataset.training.transforms import CropReturns, PointCloud
from rso_lidar.public_names import limit_dir

__all__ = [
    "Augmentation",
    "CropReturns",
    "FrameDataset",
    "FrameSampler",
    "LowerEnergy",
    "MirrorImages",
    "PointCloud",
    "QuarterTurns",
    "RedrawNoise",
    "Transform",
    "Visit",
    "stack_frames",
    "to_tensors",
]

__dir__ = limit_dir(__name__)
