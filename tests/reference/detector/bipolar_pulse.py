"""A zero-crossing discriminator in small steps of time: the oracle of `rso_lidar.detector.ranging.bipolar_pulse`."""

import numpy as np

PIECES = 256  # of a step


def refine(signal):
    """Return a signal (step) at pieces of its steps, by the cubics through four steps, and the places of the pieces."""
    place = 1.0 + np.arange((len(signal) - 3) * PIECES + 1) / PIECES
    step = np.minimum(place.astype(int), len(signal) - 3)
    value = np.zeros(len(place))
    for k in range(-1, 3):  # Lagrange's polynomials
        weight = np.ones(len(place))
        for other in {-1, 0, 1, 2} - {k}:
            weight *= (place - step - other) / (k - other)
        value += weight * signal[step + k]
    return place, value


def differentiate(signal, differentiator_s, step_s):
    """Return the bipolar signal (row, step): y = x − l with l' = (x − l)/τ, by the rule of the middle."""
    ratio, bipolar = step_s / differentiator_s / PIECES, np.empty(signal.shape)
    for row, x in enumerate(np.asarray(signal, float)):
        padded = np.concatenate([x[:1], x, np.repeat(x[-1:], 2)])
        fine, slow, at = refine(padded)[1], 0.0, 0
        bipolar[row, 0] = x[0]
        for step in range(1, len(x)):
            for _ in range(PIECES):
                middle = 0.5 * (fine[at] + fine[at + 1])
                slow = (slow * (1.0 - 0.5 * ratio) + ratio * middle) / (1.0 + 0.5 * ratio)
                at += 1
            bipolar[row, step] = x[step] - slow
    return bipolar


def find_zero_crossings(settings, bipolar, earliest, step_s):
    """Return where (row) [steps] each row crosses zero behind the clipping amplifier once it is armed, or NaN."""
    crossing, recovery = np.full(len(bipolar), np.nan), settings.recovery_ns * 1e-9 / step_s * PIECES
    for row, x in enumerate(np.asarray(bipolar, float)):
        place, value = refine(x)
        armed, charge, before = False, 0.0, 0.0
        for at, now in zip(place, value, strict=True):
            if at < int(earliest[row]):  # the channel is off
                continue
            armed = armed or now >= settings.arming_electrons
            output = now
            if recovery > 0.0 and (charge > 0.0 or now > settings.rail_electrons):
                charge = max(charge + (now - settings.rail_electrons) - charge / recovery, 0.0)
                output = settings.rail_electrons if charge > 0.0 else now
            if armed and before > 0.0 >= output:
                if at >= earliest[row]:
                    crossing[row] = at
                    break
                armed = False
            before = output
    return crossing
