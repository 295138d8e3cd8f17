"""The check whether an instrument can be simulated."""

from rso_lidar import detector
from rso_lidar.optics import read_files
from rso_lidar.scenario.tables.lidar import Lidar


def check_instrument(lidar: Lidar) -> None:
    """Read the files of an instrument, which must have been found, and refuse a detector that is too large."""
    lenses = {lidar.receiver}
    if lidar.schedule is not None and lidar.schedule.focal_length_mm is not None:
        ends = min(lidar.schedule.focal_length_mm), max(lidar.schedule.focal_length_mm)
        lenses |= {lidar.with_settings({"focal_length_mm": end}).receiver for end in ends}
    for receiver in lenses:
        read_files(lidar.laser, receiver)
    detector.check_size(lidar.detector, lidar.laser.pulse_fwhm_s, lidar.receiver.n_rows * lidar.receiver.n_cols)
