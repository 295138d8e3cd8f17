"""The simulated data sheet of a camera: detector, lens and the laser's own pulse."""
