"""Light out, light back: the laser, the receiver, the rays between them and the photons that return."""

from rso_lidar.optics.laser import Laser
from rso_lidar.optics.lens.distortion import BrownConrady, ZemaxDistortion
from rso_lidar.optics.lens.psf import AiryPsf, FieldDependentPsf, FieldPsf, GaussianPsf, GridPsf, ZemaxPsf
from rso_lidar.optics.oversampling import oversample
from rso_lidar.optics.rays.pixel_rays import pixel_rays
from rso_lidar.optics.receiver import Receiver
from rso_lidar.optics.returns.blur import read_files
from rso_lidar.optics.returns.exposure import average_pulses
from rso_lidar.optics.returns.radiometry import collect
from rso_lidar.public_names import limit_dir

__all__ = [
    "AiryPsf",
    "BrownConrady",
    "FieldDependentPsf",
    "FieldPsf",
    "GaussianPsf",
    "GridPsf",
    "Laser",
    "Receiver",
    "ZemaxDistortion",
    "ZemaxPsf",
    "average_pulses",
    "collect",
    "oversample",
    "pixel_rays",
    "read_files",
]

__dir__ = limit_dir(__name__)
