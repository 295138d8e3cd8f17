"""Sun, Moon and Earth as a spacecraft sees them: directions, precession, eclipses, and when a geometric condition holds."""
