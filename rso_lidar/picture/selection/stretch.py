"""Stretch of the images of cameras beside the lidar: from counts to brightness on a screen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.part import parse_toml
from rso_lidar.records import Frame

_GAMMA = 2.2  # of a screen: its light goes with this power of the value
_DARK_SIGMA = 2.0  # noise that stays black, in standard deviations
_LIT_SIGMA = 5.0  # light above this many standard deviations of the noise is no noise
_GLINTS = 0.5  # brightest share of the lit values that may saturate [%]
_LEAST_SIGMA = 20.0  # least span of the stretch, so that an image of noise alone stays dark


@dataclass(frozen=True)
class Stretch:
    """Counts that are black and white on a screen, the same in all bands so that colours stay.

    Parameters
    ----------
    low_counts, high_counts : at which the screen is black, and full [counts]
    """

    low_counts: float
    high_counts: float

    @staticmethod
    def of(camera: str, *frames: Frame) -> Stretch:
        """Find the stretch that suits the images of a camera in one frame or more.

        Parameters
        ----------
        camera : name of the camera
        *frames : frames with an image of it, which share the stretch

        Returns
        -------
        Stretch
            From the noise about the black level to the light that 0.5 % of the lit values exceed.
        """
        lows, highs = [], []
        for frame in frames:
            counts = frame.camera[camera].intensity_counts.ravel().astype(np.float32)
            black = _read_black_level(frame.source.scenario, camera)
            below = counts[counts < black] - black  # noise alone
            sigma = max(float(np.sqrt(np.mean(below**2))) if below.size else 0.0, 1.0)
            lit = counts[counts > black + _LIT_SIGMA * sigma]
            low = black + _DARK_SIGMA * sigma
            bright = float(np.percentile(lit, 100.0 - _GLINTS)) if lit.size else low
            lows.append(low)
            highs.append(max(bright, low + _LEAST_SIGMA * sigma))
        return Stretch(min(lows), max(highs))

    def apply(self, counts: np.ndarray) -> np.ndarray:
        """Return the values on a screen of counts, as bytes of the same shape.

        Parameters
        ----------
        counts : (…) [counts]
        """
        share = np.clip((counts.astype(np.float32) - self.low_counts) / (self.high_counts - self.low_counts), 0.0, 1.0)
        values: np.ndarray = (255.0 * share ** (1.0 / _GAMMA)).round().astype(np.uint8)
        return values

    def paint(self, counts: np.ndarray, band: int | None = None) -> np.ndarray:
        """Return the colours (row, col, rgb) of an image, as bytes.

        Parameters
        ----------
        counts : (row, col, band)
        band : that is shown in grey; None for the colours of three bands, of another number the first
        """
        if band is None and counts.shape[2] == 3:
            return self.apply(counts)
        return np.repeat(self.apply(counts[..., [band or 0]]), 3, axis=2)

    @property
    def words(self) -> tuple[str, str]:
        """The counts at both ends."""
        return f"{self.low_counts:,.0f}", f"{self.high_counts:,.0f} counts"


def _read_black_level(scenario: str, camera: str) -> float:
    """Read the black level of a camera [counts] from the resolved text of a scenario; 0 where it states none."""
    for table in parse_toml(scenario, "recording", RecordingError).get("camera", []):
        if table.get("name") == camera:
            return float(table.get("sensor", {}).get("black_level_counts", 0.0))
    return 0.0
