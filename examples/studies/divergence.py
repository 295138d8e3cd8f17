"""Which beam and which lens detect a spacecraft at 10 km, and at 50 km?

The camera has 128 x 128 pixels of 100 µm and 50 mJ at 1064 nm (Fuller et al.). What may be chosen is the aperture (the lens
stays f/2.8, so its field shrinks as it grows), the divergence, and a range gate that averages pulses.
`python examples/studies/divergence.py` prints the tables; divergence.md reads them.
"""

import math

import rso_lidar as rl

F_NUMBER = 2.8
APERTURES_MM = (105.0, 200.0, 300.0)
RANGES_M = (10_000.0, 50_000.0)
FACETS_M2 = {"fills a pixel": None, "4 m²": 4.0, "1 m²": 1.0}
WIDEST_DEG, NARROWEST_DEG = 20.0, 1e-3
TRIGGER = rl.Gsfl(armed_from_m=1000.0, armed_to_m=60_000.0)
QUIET = rl.Gsfl(
    preset="offset_limited", gate=rl.detector.Gate(delay_ns=10_000.0, pulses=16, false_alarm_probability=1e-5)
)
DETECTORS = {"trigger": TRIGGER, "gate, 16 pulses": QUIET}


def camera(aperture_mm: float, detector: rl.Gsfl) -> rl.Lidar:
    """Return the camera of Fuller et al. behind another lens and detector."""
    receiver = rl.Receiver(focal_length_mm=F_NUMBER * aperture_mm, f_number=F_NUMBER)
    return rl.Lidar(laser=rl.Laser(), receiver=receiver, detector=detector)


def reach_m(lidar: rl.Lidar, divergence_deg: float, facet_m2: float | None) -> float:
    """Return how far a facing facet, Lambertian 0.30, is detected in 95 % of the flashes [m]."""
    made = rl.budget(lidar, divergence_deg=divergence_deg, facet_m2=facet_m2, range_m=[1000.0, 60_000.0])
    far = made.curves[0].max_range_m
    return 1.0 if math.isnan(far) else far


def widest_deg(lidar: rl.Lidar, range_m: float, facet_m2: float | None) -> float:
    """Return the widest beam [deg] that still detects the facet at a range; NaN where none does."""
    from scipy.optimize import brentq

    def short(log_deg: float) -> float:
        return math.log(reach_m(lidar, math.exp(log_deg), facet_m2) / range_m)

    low, high = math.log(NARROWEST_DEG), math.log(WIDEST_DEG)
    if short(low) < 0.0:
        return math.nan
    return math.exp(brentq(short, low, high, xtol=1e-3))


def table(range_m: float, apertures_mm: tuple[float, ...] = APERTURES_MM) -> list[dict[str, float | str]]:
    """Return one row for each detector, aperture and facet: the widest beam [deg] and what it covers."""
    rows: list[dict[str, float | str]] = []
    for name, detector in DETECTORS.items():
        for aperture_mm in apertures_mm:
            lidar = camera(aperture_mm, detector)
            for what, facet_m2 in FACETS_M2.items():
                beam_deg = widest_deg(lidar, range_m, facet_m2)
                half = math.tan(0.5 * beam_deg * rl.units.DEG)
                rows.append(
                    {
                        "detector": name,
                        "aperture_mm": aperture_mm,
                        "field_deg": lidar.receiver.fov_rad / rl.units.DEG,
                        "facet": what,
                        "beam_deg": beam_deg,
                        "beam_m": 2 * half * range_m,
                        "beam_pixels": 2 * half / lidar.receiver.pixel_tangent,
                        "pixel_m": range_m * lidar.receiver.pixel_tangent,
                    }
                )
    return rows


if __name__ == "__main__":
    for range_m in RANGES_M:
        print(f"95 % at {range_m / 1000:g} km, 50 mJ, f/{F_NUMBER}: the widest beam")
        print("detector         aperture   field   pixel   facet          beam        covers      pixels")
        for row in table(range_m):
            print(
                "{detector:<16}{aperture_mm:6.0f} mm{field_deg:7.2f}°{pixel_m:6.2f} m   {facet:<14}{beam_deg:6.3f}°"
                "{beam_m:9.0f} m{beam_pixels:12.1f}".format(**row)
            )
        print()
