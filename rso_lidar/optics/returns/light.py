"""Light on the focal plane, as the steps of `collect` pass it on."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Light:
    """Light on the focal plane, ordered by pixel (return): the fields that `Photons` takes over."""

    pixel: np.ndarray
    delay_s: np.ndarray
    photons: np.ndarray
    depth_spread_s: np.ndarray
    coherence_cells: np.ndarray
    hit: np.ndarray

    def only(self, some: np.ndarray) -> "Light":
        """Return a selection of the returns."""
        return Light(*(getattr(self, name)[some] for name in Light.__dataclass_fields__))
