"""Models and materials by name: the shipped catalogue and the user's own."""

from rso_lidar.scene.library.model_index import ModelEntry, model, models, own_folder, own_models
from rso_lidar.scene.library.model_index import load_materials as materials

__all__ = ["ModelEntry", "materials", "model", "models", "own_folder", "own_models"]
