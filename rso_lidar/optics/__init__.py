"""Light out, light back: the laser, the receiver, the rays between them and the photons that return."""

from typing import TYPE_CHECKING

from rso_lidar.public_names import export_lazily, limit_dir

if TYPE_CHECKING:
    from rso_lidar.optics.laser import Laser
    from rso_lidar.optics.lens.distortion import BrownConrady, ZemaxDistortion
    from rso_lidar.optics.lens.internal_reflections import Ghost
    from rso_lidar.optics.lens.psf import AiryPsf, FieldDependentPsf, FieldPsf, GaussianPsf, GridPsf, ZemaxPsf
    from rso_lidar.optics.lens.surface_scatter import Baffle, Glare
    from rso_lidar.optics.rays.scan_lines import ScanLines, find_pixels, find_small, pixel_rays
    from rso_lidar.optics.receiver import Receiver
    from rso_lidar.optics.returns.blur import blur_steady_light, read_files
    from rso_lidar.optics.returns.pulse_average import assign_pulses, average_pulses
    from rso_lidar.optics.returns.radiometry import collect, image_flash, image_sunlight, oversample, pixel_photons
    from rso_lidar.optics.stray.glare import add_stray_light, image_sky, see_sky, veil, veil_on_axis
    from rso_lidar.optics.stray.sources import STRAY_BODIES
    from rso_lidar.optics.sunlight import sun_photons_per_s_m2
    from rso_lidar.optics.tables.laser_profiles import read_pattern
else:
    __getattr__ = export_lazily(__name__)

__all__ = [
    "STRAY_BODIES",
    "AiryPsf",
    "Baffle",
    "BrownConrady",
    "FieldDependentPsf",
    "FieldPsf",
    "GaussianPsf",
    "Ghost",
    "Glare",
    "GridPsf",
    "Laser",
    "Receiver",
    "ScanLines",
    "ZemaxDistortion",
    "ZemaxPsf",
    "add_stray_light",
    "assign_pulses",
    "average_pulses",
    "blur_steady_light",
    "collect",
    "find_pixels",
    "find_small",
    "image_flash",
    "image_sky",
    "image_sunlight",
    "oversample",
    "pixel_photons",
    "pixel_rays",
    "read_files",
    "read_pattern",
    "see_sky",
    "sun_photons_per_s_m2",
    "veil",
    "veil_on_axis",
]

__dir__ = limit_dir(__name__)
