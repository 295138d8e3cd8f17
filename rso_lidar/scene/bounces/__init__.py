"""Light from surface to surface: paths of the laser's light that meet two surfaces or more before the lens."""
