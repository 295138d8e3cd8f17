import pytest

SCENARIO = """
version = 1
name    = "a plate on a bench"
seed    = 7

[world]
axes = "local"

[time]
start_utc     = 2024-09-17T12:00:00Z
duration_s    = 2
frame_rate_hz = 5

[[target]]
name     = "plate"
model    = "plate"
material = { type = "lambertian", reflectance = 0.30 }
motion   = { type = "fixed", position_m = [1000, 0, 0] }
attitude = { type = "spin", axis = [0, 0, 1], rate_deg_s = 10 }

[follower]
motion = { type = "fixed", position_m = [0, 0, 0] }

[ptu]
point    = { type = "track", at = "plate" }
response = { type = "second_order", natural_hz = 4.0, damping = 0.7 }
errors   = { jitter_deg = 0.001, encoder_noise_deg = 0.001 }

[lidar.laser]
energy_mj = 50

[lidar.receiver]
fov_deg  = 2.5
f_number = 2.8
n_rows   = 32
n_cols   = 32
rays_per_pixel = 4
"""


@pytest.fixture
def text():
    return SCENARIO
