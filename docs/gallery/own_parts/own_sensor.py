"""
A sensor of your own
====================

A coarse Sun sensor on the follower. A sensor is any object with a name, a rate and a method `measure`: the true
motion in, samples out.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import rso_lidar as rl
from rso_lidar import sensors
from rso_lidar.records import SensorSamples, SensorState, array


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


# %%
# It flies beside the lidar in a scenario, and a recording keeps its samples by the statement of their fields.
flown = rl.Scenario.load("examples/onboard_sensors.toml", ("time.duration_s=20",))
scenario = flown.replace(name="Inspection with a Sun sensor", sensor=(SunSensor(),))
samples = [frame.observation.sensors["sun_sensor"] for frame in rl.simulate(scenario)]
time_s = np.concatenate([one.time_s for one in samples])
sun = np.concatenate([one.sun_direction for one in samples])

figure = Figure(figsize=(8, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(time_s, sun, ".-", label=["x", "y", "z"])
axes.set(xlabel="time [s]", ylabel="direction to the Sun, body axes", title="Samples of the Sun sensor")
axes.legend(ncols=3)
axes.grid()
figure

# %%
# **To try.** Let the sensor see one hemisphere only, with `valid` false elsewhere. Shipped sensors and their error
# models: :doc:`/sensors`.
