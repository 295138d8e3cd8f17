"""Full waveforms that a real flash lidar recorded, and those of the simulated chain beside them."""
