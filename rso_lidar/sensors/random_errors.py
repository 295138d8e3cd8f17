"""Random errors of a sensor: white noise, processes with a memory and outages, each draw addressed by its sample.

Every random number is a function of the sensor's key (from seed and name), of the number of the sample and of its use. A
process with a memory (a Gauss-Markov process, a random walk or a constant) obeys x(n) = decay x(n-1) + drive w(n) with
x(0) = start w(0), which is exact for its sampling interval. So the bits do not depend on how samples are divided among
calls.
"""

from __future__ import annotations

import hashlib
import math
from typing import NamedTuple

import numpy as np

from rso_lidar.kernels import kernel, packed
from rso_lidar.philox import draw_block

NOISE, OUTAGE, START = 0, 1, 2  # the last word of a counter: what a draw is for


class ErrorModel(NamedTuple):
    """Random errors of all channels of a sensor, for its sampling interval."""

    white: np.ndarray  # (channel) standard deviation of the white noise of a sample
    process: np.ndarray  # (process, 3) decay, drive and start
    channel: np.ndarray  # (process) to which its value is added; -1 for those that a sensor applies itself
    n_driven: int  # the first processes change; the others are constants
    outage: np.ndarray  # (3) probability to be out after a sample that is out, after one that is not, and at sample 0

    @property
    def n_values(self) -> int:
        """Number of entries of the state: the processes, and whether the sensor is out."""
        return len(self.process) + 1


class ErrorProcess(NamedTuple):
    """One process of each of some channels."""

    channels: tuple[int, ...]
    decay: float
    drive: float
    start: float


def make_model(white: np.ndarray, processes: list[ErrorProcess], outage: tuple[float, float, float]) -> ErrorModel:
    """Join processes to a model; those without effect are left out, constants come last.

    Parameters
    ----------
    white : (channel) standard deviation of the white noise of a sample
    processes : in any order. Channel -1 marks a constant that the sensor applies itself; those are kept, in their order
    outage : probabilities as in `ErrorModel`
    """
    effective = [it for it in processes if it.drive or it.start or it.channels[0] < 0]
    ordered = sorted(effective, key=lambda it: (it.drive == 0.0, it.channels[0] >= 0))
    rows = [(it.decay, it.drive, it.start) for it in ordered for _ in it.channels]
    return ErrorModel(
        packed(white, np.float64),
        packed(np.array(rows, np.float64).reshape(-1, 3)),
        packed(np.array([channel for it in ordered for channel in it.channels], np.int64)),
        sum(len(it.channels) for it in ordered if it.drive),
        packed(np.array(outage, np.float64)),
    )


def make_key(seed: int, name: str) -> np.ndarray:
    """Make the key (2) uint32 of a sensor's random numbers, different for each seed and each name.

    Parameters
    ----------
    seed : of the scenario
    name : of the sensor

    Returns
    -------
    key (2) uint32
    """
    words = np.frombuffer(hashlib.sha256(f"sensor {name}".encode()).digest(), np.uint32)
    return packed(np.random.SeedSequence([seed, *(int(word) for word in words)]).generate_state(2, np.uint32))


def draw_normals(key: np.ndarray, first_sample: int, count: int, width: int) -> np.ndarray:
    """Draw standard normal numbers (sample, width): those of a sample are the same in any call.

    Parameters
    ----------
    key : (2) uint32, of the sensor
    first_sample, count : number of the first sample, and how many
    width : numbers for each sample

    Returns
    -------
    array (count, width) of float64
    """
    normals = np.empty((count, width))
    fill_normals(key, first_sample, NOISE, normals)
    return normals


@kernel
def fill_normals(key: np.ndarray, first: int, stage: int, normals: np.ndarray) -> None:
    """Write standard normal numbers (sample, width) by Box and Muller's method."""
    for k in range(normals.shape[0]):
        draw_sample(key, first + k, stage, normals[k])


@kernel
def draw_sample(key: np.ndarray, sample: int, stage: int, normals: np.ndarray) -> None:
    """Write the standard normal numbers of one sample; each block of four words gives four of them.

    Parameters
    ----------
    key : (2) uint32
    normals : (width), written
    """
    width = len(normals)
    for block in range((width + 3) // 4):
        words = draw_block(key, sample, sample >> 32, block, stage)
        radius = math.sqrt(-2.0 * math.log((np.float64(words[0]) + 1.0) * 2.0**-32))
        angle = np.float64(words[1]) * (2.0 * math.pi * 2.0**-32)
        j = 4 * block
        normals[j] = radius * math.cos(angle)
        if j + 1 < width:
            normals[j + 1] = radius * math.sin(angle)
        if j + 2 < width:
            radius = math.sqrt(-2.0 * math.log((np.float64(words[2]) + 1.0) * 2.0**-32))
            angle = np.float64(words[3]) * (2.0 * math.pi * 2.0**-32)
            normals[j + 2] = radius * math.cos(angle)
            if j + 3 < width:
                normals[j + 3] = radius * math.sin(angle)


@kernel
def draw_errors(
    key: np.ndarray,
    first: int,
    skipped: int,
    white: np.ndarray,
    process: np.ndarray,
    channel: np.ndarray,
    n_driven: int,
    outage: np.ndarray,
    values: np.ndarray,
    errors: np.ndarray,
    out: np.ndarray,
) -> None:
    """Advance the processes of a sensor over samples, and write the errors of the last ones.

    Parameters
    ----------
    key : (2) uint32, of the sensor
    first : number of the sample after the state
    skipped : number of samples without output before those of `errors`
    white, process, channel, n_driven, outage : as in `ErrorModel`
    values : (process + 1) state at the sample before `first`, advanced in place; its last entry is 1 in an outage
    errors : (sample, channel), written
    out : (sample) bool, written: whether the sensor is in an outage
    """
    n_process, n_channel = len(process), len(white)
    normals = np.empty(n_driven + n_channel)
    if first == 0:
        started = np.empty(n_process)
        draw_sample(key, 0, START, started)
        for p in range(n_process):
            values[p] = process[p, 2] * started[p]
    for k in range(-skipped, len(errors)):
        n = first + skipped + k
        draw_sample(key, n, NOISE, normals[: n_driven if k < 0 else n_driven + n_channel])
        if n > 0:
            for p in range(n_driven):
                values[p] = process[p, 0] * values[p] + process[p, 1] * normals[p]
        if outage[2] > 0.0:
            word = draw_block(key, n, n >> 32, 0, OUTAGE)[0]
            chance = outage[2] if n == 0 else outage[0] if values[n_process] > 0.0 else outage[1]
            values[n_process] = 1.0 if (np.float64(word) + 0.5) * 2.0**-32 < chance else 0.0
        if k >= 0:
            out[k] = values[n_process] > 0.0
            for c in range(n_channel):
                errors[k, c] = white[c] * normals[n_driven + c]
            for p in range(n_process):
                if channel[p] >= 0:
                    errors[k, channel[p]] += values[p]
