"""The link budget in closed form, without a mesh."""

from rso_lidar.optics import Laser, Receiver


def filled_pixel_photons(laser: Laser, receiver: Receiver, brdf_per_sr: float, range_m: float) -> float:
    """Return the photons of a pixel on the boresight that a facet facing the lidar fills.

    Fuller et al., eq. 7, with the factor 4 (or the area of another footprint), before the APD.

    Examples
    --------
    >>> from rso_lidar.optics import Laser, Receiver
    >>> from math import pi
    >>> round(filled_pixel_photons(Laser(), Receiver(fov_deg=2.5, f_number=2.8), 0.30 / pi, 3000.0))
    1001
    """
    gathered = receiver.pixel_tangent**2 * receiver.aperture_area_m2 * receiver.transmission / range_m**2
    return float(laser.density(0.0, 0.0)) * brdf_per_sr * gathered  # type: ignore[arg-type]
