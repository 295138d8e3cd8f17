"""A user-defined sensor: a coarse Sun sensor on the follower, which gives the direction to the Sun in body axes.

Any object with a name, a rate and `measure` can be a sensor; `rso_lidar.sensors.Sensor` describes its arguments.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from rso_lidar import sensors
from rso_lidar.records import BodyMotion, SensorSamples, SensorState, array


@dataclass(frozen=True, eq=False, repr=False)
class SunSamples(SensorSamples):
    """Samples of a Sun sensor."""

    sun_direction: np.ndarray = array("sample xyz", "f8", "1", "measured direction to the Sun in body axes")


@dataclass(frozen=True)
class SunSensor:
    """Photodiodes that together see the whole sky; `sigma` is their noise as a share of full sunlight."""

    name: str = "sun_sensor"
    rate_hz: float = 2.0
    sigma: float = 0.01

    def measure(self, motion, key, first_sample, state=None):
        n = len(motion.time_s)
        turned = Rotation.from_quat(motion.quaternion_xyzw).as_matrix()  # inertial_from_body
        true = np.einsum("kji,kj->ki", turned, motion.sun_direction)
        noisy = true + self.sigma * sensors.draw_normals(key, first_sample, n, 3)
        seen = noisy / np.linalg.norm(noisy, axis=1, keepdims=True)
        samples = SunSamples(motion.time_s, motion.time_s, np.full(n, True), seen)
        return samples, SensorState(first_sample + n, np.empty(0))


def spin(time_s):
    """Return the motion of a follower that turns once a minute about its z axis, with the Sun along the inertial x axis."""
    n, rate = len(time_s), 2.0 * np.pi / 60.0
    turned = Rotation.from_rotvec(rate * time_s[:, None] * [0.0, 0.0, 1.0]).as_quat()
    zero, sun = np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0], (n, 1))
    return BodyMotion(time_s, zero, zero, turned, zero + np.array([0.0, 0.0, rate]), zero, sun_direction=sun)


if __name__ == "__main__":
    sensor, state = SunSensor(), None
    key = sensors.make_key(7, sensor.name)
    for second in range(5):
        numbers = range(int(second * sensor.rate_hz), int((second + 1) * sensor.rate_hz))
        motion = spin(sensors.read_schedule(sensor).time_samples(numbers))
        samples, state = sensors.measure_samples(sensor, motion, key, numbers.start, state)
        for time_s, (x, y, z) in zip(samples.time_s, samples.sun_direction, strict=True):
            print(f"{time_s:5.1f} s  Sun at {x:+.3f} {y:+.3f} {z:+.3f}")
