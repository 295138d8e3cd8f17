"""PyTorch, or one line that says how to install it."""

from arguments import stop

try:
    import torch
except ModuleNotFoundError:
    stop("torch: is not installed: pip install 'rso-lidar[learn]'")

__all__ = ["torch"]
