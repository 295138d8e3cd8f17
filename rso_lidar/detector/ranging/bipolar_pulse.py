"""The bipolar pulse of a zero-crossing discriminator: a differentiator, an amplifier that clips, and the crossing."""

import math

import numpy as np

from rso_lidar import units
from rso_lidar.detector.ranging.pulse import Pulse
from rso_lidar.detector.settings.zero_crossing import ZeroCrossing
from rso_lidar.kernels import kernel, packed

_PIECES = 8  # of a step, in which a clipping amplifier is followed


def crossing_lead_s(pulse: Pulse, differentiator_s: float) -> float:
    """Return when a linear return crosses zero behind a differentiator [s after its nominal delay].

    The differentiator is y = x − l with l' = (x − l)/τ, solved exactly for straight lines between the points of the table.
    """
    from scipy.signal import lfilter

    ratio = pulse.step_s / differentiator_s
    keep = math.exp(-ratio)
    mean = -math.expm1(-ratio) / ratio
    bipolar = pulse.table - lfilter([1.0 - mean, mean - keep], [1.0, -keep], pulse.table)
    top = int(bipolar.argmax())
    after = top + int((bipolar[top:] <= 0.0).argmax())
    share = bipolar[after - 1] / (bipolar[after - 1] - bipolar[after])
    return pulse.from_s + (after - 1 + float(share)) * pulse.step_s


def differentiate(signal: np.ndarray, differentiator_s: float, step_s: float) -> np.ndarray:
    """Return the bipolar signal (row, step), float32: y = x − l with l' = (x − l)/τ, from rest before the first step.

    Between two steps x is the cubic through the four steps around.

    Parameters
    ----------
    signal : (row, step) x
    differentiator_s : τ [s]
    step_s : length of a step [s]
    """
    ratio = step_s / differentiator_s
    node, share = np.polynomial.legendre.leggauss(8)
    node, share = 0.5 * (node + 1.0), 0.5 * share
    fading = share * ratio * np.exp(-ratio * (1.0 - node))
    weights = (cubic_weights(node) * fading).sum(axis=1)
    bipolar = np.empty(signal.shape, np.float32)
    differentiate_rows(packed(signal, np.float32), math.exp(-ratio), weights, bipolar)
    return bipolar


def cubic_weights(place: np.ndarray) -> np.ndarray:
    """Return the weights (4, place) of the steps -1, 0, 1 and 2 in the cubic through them, at places from 0 to 1."""
    x = np.asarray(place)
    weights: np.ndarray = np.stack(
        [
            x * (1.0 - x) * (x - 2.0) / 6.0,
            (1.0 - x * x) * (2.0 - x) / 2.0,
            x * (1.0 + x) * (2.0 - x) / 2.0,
            x * (x * x - 1.0) / 6.0,
        ]
    )
    return weights


@kernel
def differentiate_rows(signal: np.ndarray, keep: float, weights: np.ndarray, bipolar: np.ndarray) -> None:
    """Write the bipolar signal of each row.

    Parameters
    ----------
    signal : (row, step)
    weights : (4) of the steps around in what a step adds to the slow part
    bipolar : (row, step) written
    """
    last = signal.shape[1] - 1
    for row in range(signal.shape[0]):
        x, slow = signal[row], 0.0
        bipolar[row, 0] = x[0]
        for step in range(last):
            added = weights[0] * x[max(step - 1, 0)] + weights[1] * x[step] + weights[2] * x[step + 1]
            slow = keep * slow + added + weights[3] * x[min(step + 2, last)]
            bipolar[row, step + 1] = x[step + 1] - slow


def find_zero_crossings(settings: ZeroCrossing, bipolar: np.ndarray, earliest: np.ndarray, step_s: float) -> np.ndarray:
    """Return where (row) [steps] each bipolar signal first crosses zero downward once it is armed, or NaN.

    Parameters
    ----------
    bipolar : (row, step) [electrons]
    earliest : (row) the channel is off before this place [steps]
    """
    crossing = np.empty(len(bipolar))
    weights = np.ascontiguousarray(cubic_weights(np.arange(1, _PIECES + 1) / _PIECES).T)
    cross_zero(
        packed(bipolar, np.float32),
        packed(earliest, np.float64),
        settings.arming_electrons,
        settings.rail_electrons,
        settings.recovery_ns * units.NS / step_s,
        weights,
        crossing,
    )
    return crossing


@kernel
def cross_zero(
    bipolar: np.ndarray,
    earliest: np.ndarray,
    arming: float,
    rail: float,
    recovery: float,
    weights: np.ndarray,
    crossing: np.ndarray,
) -> None:
    """Write where each row crosses zero behind an amplifier that clips.

    While the amplifier's stored charge q is above zero its output stays on the rail: dq/dt = (x − rail) − q/τ. Without
    charge the output is the input.

    Parameters
    ----------
    bipolar : (row, step) input x of the amplifier [electrons]
    earliest : (row) the channel is off before [steps]
    arming, rail : levels [electrons]
    recovery : τ of the stored charge [steps]
    weights : (piece, 4) of the steps around at the end of each piece of a step
    crossing : (row) [steps], written; NaN without a crossing
    """
    n, pieces = bipolar.shape[1], weights.shape[0]
    length = 1.0 / pieces
    keep = math.exp(-length / recovery) if recovery > 0.0 else 0.0
    for row in range(bipolar.shape[0]):
        x, armed, charge = bipolar[row], False, 0.0
        crossing[row] = np.nan
        for step in range(max(1, int(earliest[row])), n - 2):
            low, high = min(x[step], x[step + 1]), max(x[step], x[step + 1])
            armed = armed or high >= arming
            if not armed or (charge == 0.0 and low > 0.0 and high <= rail):
                continue
            before, piece, place = np.float64(x[step]), 0, np.nan
            while piece < pieces and np.isnan(place):
                after = np.float64(0.0)
                for k in range(4):
                    after += weights[piece, k] * x[step - 1 + k]
                held = -1.0  # share of the piece after which the output leaves the rail
                if charge > 0.0 or before > rail or after > rail:
                    more = charge * keep + recovery * (1.0 - keep) * (0.5 * (before + after) - rail)
                    held = charge / (charge - more) if charge > 0.0 and more <= 0.0 else -1.0
                    charge = max(more, 0.0)
                if charge == 0.0 and after <= 0.0:
                    if before > 0.0:
                        place = step + (piece + max(held, before / (before - after))) * length
                    elif held >= 0.0:
                        place = step + (piece + held) * length
                before = after
                piece += 1
            if np.isnan(place):
                continue
            if place >= earliest[row]:
                crossing[row] = place
                break
            armed = False
