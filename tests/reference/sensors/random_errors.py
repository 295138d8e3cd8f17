"""The oracle of `rso_lidar.sensors.random_errors`: random errors of a sensor, one sample after the other in NumPy."""

import numpy as np

from tests.reference import philox

NOISE, OUTAGE, START = 0, 1, 2


def fill_normals(key, first, stage, width, count):
    """Return standard normal numbers (sample, width) by Box and Muller, two from each pair of words."""
    n = np.arange(first, first + count)[:, None]
    words = philox.blocks(key, n, n >> 32, np.arange((width + 3) // 4)[None, :], stage)
    pairs = words.reshape(count, -1, 2).astype(float)
    radius = np.sqrt(-2.0 * np.log((pairs[..., 0] + 1.0) / 2**32))
    angle = 2.0 * np.pi * pairs[..., 1] / 2**32
    both = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    return both.reshape(count, -1)[:, :width]


def draw_errors(key, model, count):
    """Return the errors (sample, channel) of samples from 0, whether they are out (sample), and the state after them."""
    n_process, n_channel = len(model.process), len(model.white)
    normals = fill_normals(key, 0, NOISE, model.n_driven + n_channel, count)
    values = np.zeros(n_process + 1)
    values[:-1] = model.process[:, 2] * fill_normals(key, 0, START, n_process, 1)[0]
    errors, out = np.zeros((count, n_channel)), np.zeros(count, bool)
    for n in range(count):
        if n:
            decay, drive = model.process[: model.n_driven, 0], model.process[: model.n_driven, 1]
            values[: model.n_driven] = decay * values[: model.n_driven] + drive * normals[n, : model.n_driven]
        share = (philox.blocks(key, n, n >> 32, 0, OUTAGE)[0] + 0.5) / 2**32
        after_out, after_up, at_first = model.outage
        values[-1] = share < (at_first if n == 0 else after_out if values[-1] else after_up)
        out[n] = values[-1]
        errors[n] = model.white * normals[n, model.n_driven :]
        np.add.at(errors[n], model.channel[model.channel >= 0], values[:-1][model.channel >= 0])
    return errors, out, values
