"""A small scenario with star tracker and GNSS, for tests of orbit determination."""

from pathlib import Path

import rso_lidar as rl

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
SMALL = (
    "time.duration_s=40",
    "time.frame_rate_hz=0.5",
    "lidar.receiver.n_rows=32",
    "lidar.receiver.n_cols=32",
    "lidar.receiver.min_rays_per_target=0",
    "sensor.gnss.outages=[]",
    'follower.motion={type="nonlinear", relative_to="stage", position_m=[0, -60, 4], velocity_m_s=[0.02, -0.05, 0]}',
)


def load_small(*more):
    """Return the scenario of 20 frames, 2 s apart, of a spinning stage at 60 m, with further settings."""
    return rl.Scenario.load(EXAMPLES / "onboard_sensors.toml", (*SMALL, *more))
