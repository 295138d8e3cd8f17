"""The whole walk on one page: a photon goes through the rooms once, in order, and never turns back."""

import operator
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from rso_lidar import detector, motion, optics, sampling, scene
from rso_lidar.errors import ScenarioError
from rso_lidar.first_start import compile_ahead
from rso_lidar.philox import draw_key
from rso_lidar.processes import Processes
from rso_lidar.records import Command, Frame, Labels, Observation, Reading, Record, Truth
from rso_lidar.scenario import Lidar, Scenario, require_scenario
from rso_lidar.track.controller import Controller

DETECTION, POINTING = 0, 1  # the stages that draw noise, each from a generator of its own
KEPT = ("rays", "hits", "signal", "photons", "taps", "waveforms", "oversampled", "prediction")


def simulate(
    scenario: Scenario,
    controller: Controller | None = None,
    *,
    frames: slice | Iterable[int] | None = None,
    threads: int | None = None,
    workers: int | None = None,
    keep: Iterable[str] = (),
) -> Iterator[Frame]:
    """Simulate a scenario and yield one frame per laser flash.

    Parameters
    ----------
    scenario : to be simulated.
    controller : called with each frame's Observation. The Command that it returns acts from the next flash on.
    frames : indices of frames to make, ascending, or a slice (None: all). Frame k depends on scenario, seed and k
        only. Under a controller it depends on history, so the two cannot be combined.
    threads : number of threads (None: one per core). The result is bit for bit the same.
    workers : number of processes that make frames, instead of threads, for machines with many cores. A script that
        uses them needs ``if __name__ == "__main__":`` around its own code. The result is bit for bit the same.
    keep : names of intermediate records to leave in ``frame.kept``: rays, hits, signal, photons, taps, waveforms,
        oversampled, prediction. ``signal`` is the photons without stray light, which the labels describe. ``taps`` holds the
        signals between the stages of the detector, ``prediction`` the probability and the scatter of each pixel's report.

    Yields
    ------
    Frame
        In the order of the indices.

    Raises
    ------
    ScenarioError
        If the arguments contradict each other, or the scenario cannot be simulated.
    """
    require_scenario(scenario, "simulate")
    kept = _check_kept(keep, scenario)
    for name, count in (("threads", threads), ("workers", workers)):
        if count is not None and (not isinstance(count, int) or isinstance(count, bool) or count < 1):
            raise ScenarioError(f"{name}: needs a whole number from 1, not {count!r}; or leave it out")
    if threads is not None and workers is not None:
        raise ScenarioError("simulate: frames are made by threads or by workers; leave out one")
    numbers = frame_numbers(scenario, frames)
    if controller is not None and not callable(controller):
        raise ScenarioError(f"simulate: a controller is called with each Observation; {controller!r:.60} cannot be")
    if controller is not None and frames is not None:
        raise ScenarioError("simulate: frames depend on history with a controller; leave out frames or the controller")
    if controller is not None and workers is not None:
        raise ScenarioError("simulate: under a controller each frame waits for the one before; leave out workers")
    return _fly(scenario, controller, numbers, threads, workers, kept)


def _fly(
    scenario: Scenario,
    controller: Controller | None,
    numbers: np.ndarray,
    threads: int | None,
    workers: int | None,
    keep: tuple[str, ...],
) -> Iterator[Frame]:
    """Yield the frames of a simulation; the parameters are those of `simulate`, checked.

    Parameters
    ----------
    scenario, controller : to be simulated, and called with each Observation.
    numbers : indices of the frames.
    threads, workers : number of threads, or of processes.
    keep : names of records to keep.
    """
    _ = (
        scenario.surfaces,
        scenario.source,
        scenario.instrument,
        scenario.exposure,
    )  # computed once, before workers share them
    with scenario.locate_errors():
        world: Any = {"local": scenario.is_local, "sun_direction": scenario.world.sun_direction}
        commanded, exposure_s = controller is not None, scenario.lidar.exposure_s
        epochs = scenario.epochs(numbers)
        course = motion.Course(scenario.bodies, epochs, commanded=commanded, exposure_s=exposure_s, **world)
        aim = motion.Aim(
            scenario.pan_tilt, scenario.lidar.mount, scenario.bodies, *scenario.span, flights=course.flights, **world
        )
    # Open loop: frames are made in parallel. Under a controller: bands of pixels are.
    threads = threads or os.cpu_count() or 1
    at_once, ahead, bands = workers or threads, 2 * workers if workers else threads, 1
    if controller:
        at_once, ahead, bands = 1, 0, threads
    if threads > 1 and not workers:
        compile_ahead()
    made: deque[Callable[[], Frame]] = deque()
    command: Command | None = None
    with _run_in_parallel(scenario, at_once, in_processes=workers is not None) as begin:
        for row, k in enumerate(numbers.tolist()):
            truth = aim.at(course.at(row, command), command, scenario.rng(k, POINTING))
            lidar = scenario.instrument.at(truth.time_s, command)
            if scenario.exposure:
                truth = scenario.exposure.follow(truth, course, aim, row, lidar)
            made.append(begin(truth, scenario.rng(k, DETECTION), bands, lidar=lidar, index=k, keep=keep))
            if len(made) <= ahead:
                continue
            frame = made.popleft()()
            yield frame
            command = _command(controller, frame, scenario) if controller else None
        while made:
            yield made.popleft()()


@contextmanager
def _run_in_parallel(
    scenario: Scenario, count: int, *, in_processes: bool
) -> Iterator[Callable[..., Callable[[], Frame]]]:
    """Yield a function that starts a flash in the background.

    It takes the arguments of `flash` without the scenario, and returns a function that waits for the frame.

    Parameters
    ----------
    scenario : what is flown.
    count : number of threads or processes.
    in_processes : whether processes work instead of threads.
    """
    if not in_processes:
        with ThreadPoolExecutor(count, thread_name_prefix="flash") as threads:
            yield lambda *given, **chosen: threads.submit(flash, scenario, *given, **chosen).result
        return
    with Processes(count, partial(_make_part, scenario)) as processes:

        def begin(truth: Truth, *given: Any, lidar: Lidar, index: int, **chosen: Any) -> Callable[[], Frame]:
            future = processes.submit(truth, *given, lidar=lidar, index=index, **chosen)
            return lambda: _assemble_frame(scenario, truth, lidar, index, *processes.result(future))

        yield begin


def _make_part(*given: Any, **chosen: Any) -> tuple[Reading, Labels, dict[str, Record]]:
    """Make a frame and return what only it holds: the rest need not travel between processes."""
    frame = flash(*given, **chosen)
    return frame.observation.reading, frame.labels, dict(frame.kept)


def _command(controller: Controller, frame: Frame, scenario: Scenario) -> Command | None:
    """Ask the controller for its command for the next flash: the only feedback there is.

    Parameters
    ----------
    controller : the user's function.
    frame : the last flash, of which the controller gets the observation.
    scenario : what is flown.
    """
    command = controller(frame.observation)
    if command is not None and not isinstance(command, Command):
        raise ScenarioError(f"simulate: the controller returned {command!r:.60}; it returns a Command or None")
    if command is None:
        return None
    if scenario.ptu is None and (command.pan_rad is not None or command.tilt_rad is not None):
        raise ScenarioError("simulate: the controller commands a PTU and the scenario has none; add [ptu]")
    return command


def flash(
    scenario: Scenario,
    truth: Truth,
    rng: np.random.Generator,
    threads: int | None = None,
    *,
    lidar: Lidar | None = None,
    index: int = 0,
    keep: tuple[str, ...] = (),
) -> Frame:
    """Simulate the frame of one laser pulse, or of those that the detector averages. Call its lines for what is between.

    Parameters
    ----------
    scenario : to be simulated.
    truth : poses of all bodies at one epoch; its `exposure` says how they move while the pulses of the frame are sent.
    rng : generator of all noise of this frame.
    threads : number of threads (None: one per core). The result is bit for bit the same.
    lidar : the instrument with the settings in force (None: as planned for this time).
    index : of the frame.
    keep : names of intermediate records to leave in ``frame.kept``.

    Returns
    -------
    Frame
    """
    require_scenario(scenario, "flash")
    surfaces, lidar = scenario.surfaces, lidar or scenario.instrument.at(truth.time_s)
    receiver, pulses = lidar.receiver, lidar.detector.traits.pulses
    laser, late_s, jitter = lidar.laser.fire_pulses(rng, pulses)
    by_epoch, with_stray_light = [], []
    for at in truth.cast_epochs:  # several where a frame has several pulses and the scene moves between them
        hits = sampling.cast_pixels(receiver, laser, surfaces, at, threads)
        bounces = None
        if lidar.bounces > 1:
            bounces = scene.bounce(hits, surfaces, at, draw_key(rng), threads, laser_from_m=laser.offset)
        photons = optics.collect(hits, laser, receiver, late_s, bounces)
        by_epoch.append((hits, photons))
        if receiver.has_stray_light:
            moon_m = scenario.moon_position_m(at.time_s)
            sky = optics.see_sky(laser, receiver, at, moon_m, has_earth=not scenario.is_local)
            hidden = None if sky is None else scene.find_hidden(sky.direction, surfaces, at)
            stray = optics.add_stray_light(photons, hits, laser, receiver, sky, hidden, pulses)
            with_stray_light.append((hits, stray))
    hits, photons = optics.average_pulses(by_epoch, pulses, jitter)
    signal = photons
    labels = scene.label(hits, signal, lidar.max_returns)  # of what is really there: without stray light
    if with_stray_light:
        _, photons = optics.average_pulses(with_stray_light, pulses, jitter)
    taps = None
    if "taps" in keep:
        reading, waveforms, taps = detector.detect_with_taps(photons, lidar.detector, rng, threads)
    else:
        reading, waveforms = detector.detect(photons, lidar.detector, rng, threads)
    made: dict[str, Record | None] = {"rays": hits.rays, "hits": hits, "signal": signal, "photons": photons}
    made |= {"taps": taps, "waveforms": waveforms}
    if "oversampled" in keep:
        made["oversampled"] = optics.oversample(hits, laser, receiver)
    if "prediction" in keep:
        made["prediction"] = detector.predict_pixels(photons, lidar.detector, labels.range_m, threads=threads)
    kept = {name: record for name in keep if (record := made[name]) is not None}
    return _assemble_frame(scenario, truth, lidar, index, reading, labels, kept)


def _assemble_frame(
    scenario: Scenario,
    truth: Truth,
    lidar: Lidar,
    index: int,
    reading: Reading,
    labels: Labels,
    kept: dict[str, Record],
) -> Frame:
    """Assemble a frame: reading and labels, with what the spacecraft could know and where the frame comes from.

    Parameters
    ----------
    scenario, truth, lidar, index : what was flown, where everything was, the instrument in force, number of the frame.
    reading, labels : what the sensor said, and what was there.
    kept : intermediate records that the user requested.
    """
    measured = truth.pointing.measured_rad if truth.pointing else None
    observation = Observation(truth.time_s, reading, lidar.settings, lidar.receiver.line_of_sight, measured)
    return Frame(index, observation, labels, truth, scenario.source, kept)


def frame_numbers(scenario: Scenario, frames: slice | Iterable[int] | None) -> np.ndarray:
    """Return the numbers of the frames that `frames` chooses.

    Raises
    ------
    ScenarioError : if `frames` does not choose frames of this scenario.
    """
    n_frames = scenario.time.n_frames
    if frames is None:
        return np.arange(n_frames)
    try:
        numbers = (
            np.arange(n_frames)[frames] if isinstance(frames, slice) else np.array([operator.index(k) for k in frames])
        )
    except (TypeError, ValueError, OverflowError):
        raise ScenarioError(
            f"frames: need a slice or whole numbers, not {frames!r:.60}; such as range(0, 10)"
        ) from None
    if not len(numbers):
        raise ScenarioError(f"frames: the choice is empty; the scenario has frames 0 to {n_frames - 1}")
    if numbers[0] < 0 or numbers[-1] >= n_frames or np.any(np.diff(numbers) <= 0):
        raise ScenarioError(f"frames: need ascending numbers from 0 to {n_frames - 1}")
    return numbers


def _check_kept(keep: Iterable[str], scenario: Scenario) -> tuple[str, ...]:
    if not isinstance(keep, Iterable):
        raise ScenarioError(f"keep: {keep!r:.40} is not a list of names; known: {', '.join(KEPT)}")
    names = (keep,) if isinstance(keep, str) else tuple(keep)
    for name in names:
        if name not in KEPT:
            raise ScenarioError(f"keep: no intermediate record '{name}'; known: {', '.join(KEPT)}")
    traits = scenario.lidar.detector.traits
    for name, is_made in (("waveforms", traits.has_waveforms), ("taps", traits.has_taps)):
        if name in names and not is_made:
            kind = getattr(scenario.lidar.detector, "type", type(scenario.lidar.detector).__name__)
            raise ScenarioError(f'keep: the detector "{kind}" has no {name}; set lidar.detector.type = "gsfl"')
    return names
