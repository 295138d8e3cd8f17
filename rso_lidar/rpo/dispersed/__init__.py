"""Many flights of one plan at once: how errors of the start, burns and navigation spread it."""
