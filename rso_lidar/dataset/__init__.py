"""Many frames recorded for learning, with labels that training needs."""

from rso_lidar.dataset.annotation.frame_labels import FrameLabels, label_frame
from rso_lidar.public_names import limit_dir

__all__ = ["FrameLabels", "label_frame"]

__dir__ = limit_dir(__name__)
