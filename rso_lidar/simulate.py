"""The whole walk on one page: a photon goes through the house once, room by room, and never turns back."""

import operator
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

from rso_lidar import detector, motion, optics, scene
from rso_lidar.errors import ScenarioError
from rso_lidar.records import Command, Frame, Observation, Record, Truth
from rso_lidar.scenario import Lidar, Scenario

Controller = Callable[[Observation], Command | None]

DETECTION, POINTING = 0, 1  # the stages that draw noise, each from a generator of its own
KEPT = ("rays", "hits", "photons", "waveforms", "oversampled")


def simulate(
    scenario: Scenario,
    controller: Controller | None = None,
    *,
    frames: slice | Iterable[int] | None = None,
    threads: int | None = None,
    keep: Iterable[str] = (),
) -> Iterator[Frame]:
    """Yield one Frame per laser flash.

    Parameters
    ----------
    scenario : what to fly.
    controller : called with each frame's Observation; the Command it returns acts from the next flash on.
    frames : which frames to make, as a slice or numbers that rise (None: all). Frame k depends on scenario, seed and k
        only, so it may not be combined with a controller, which depends on history.
    threads : how many threads work at once (None: one for each core); it does not change a bit.
    keep : names of intermediate records to leave in ``frame.kept``: rays, hits, photons, waveforms, oversampled.
    """
    kept = _known(keep, scenario)
    if threads is not None and (not isinstance(threads, int) or threads < 1):
        raise ScenarioError(
            f"threads: needs a whole number from 1, not {threads!r}; leave it out for one for each core"
        )
    numbers = frame_numbers(scenario, frames)
    if controller is not None and not callable(controller):
        raise ScenarioError(f"simulate: a controller is called with each Observation; {controller!r:.60} cannot be")
    if controller is not None and frames is not None:
        raise ScenarioError("simulate: frames depend on history with a controller; leave out frames or the controller")
    return _fly(scenario, controller, numbers, threads, kept)


def _fly(
    scenario: Scenario,
    controller: Controller | None,
    numbers: np.ndarray,
    threads: int | None,
    keep: tuple[str, ...],
) -> Iterator[Frame]:
    _ = scenario.surfaces, scenario.source, scenario.instrument  # worked out once, before workers share them
    with scenario.placed():
        world: Any = {"local": scenario.local, "sun_direction": scenario.world.sun_direction}
        course = motion.Course(scenario.bodies, scenario.epochs(numbers), commanded=controller is not None, **world)
        aim = motion.Aim(
            scenario.pan_tilt, scenario.lidar.mount, scenario.bodies, *scenario.span, flights=course.flights, **world
        )
    # Frames that nobody waits for are made side by side; under a controller, rows of pixels are.
    ahead, bands = (0, threads) if controller else (threads or os.cpu_count() or 1, 1)
    made: deque[Future[Frame]] = deque()
    command: Command | None = None
    with ThreadPoolExecutor(max(1, ahead), thread_name_prefix="flash") as workers:
        for row, k in enumerate(numbers.tolist()):
            truth = aim.at(course.at(row, command), command, scenario.rng(k, POINTING))
            lidar = scenario.instrument.at(truth.time_s, command)
            rng = scenario.rng(k, DETECTION)
            made.append(workers.submit(flash, scenario, truth, rng, bands, lidar=lidar, index=k, keep=keep))
            if len(made) <= ahead:
                continue
            frame = made.popleft().result()
            yield frame
            command = _command(controller, frame, scenario) if controller else None
        while made:
            yield made.popleft().result()


def _command(controller: Controller, frame: Frame, scenario: Scenario) -> Command | None:
    """Return what the controller asks of the next flash: the only feedback there is."""
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
    """Return the frame of one laser pulse. Whoever wants an intermediate product calls these lines himself.

    `lidar` is the instrument with what is in force (None: as planned for this instant).
    """
    surfaces, lidar = scenario.surfaces, lidar or scenario.instrument.at(truth.time_s)
    receiver = lidar.receiver
    laser, late_s = lidar.laser.fire(rng)
    extent = scene.extent(surfaces, truth)
    rays = optics.pixel_rays(receiver, laser, extent)
    hits = scene.cast(
        rays,
        surfaces,
        truth,
        threads,
        laser_from_m=laser.offset,
        sun=receiver.filter_width_nm is not None,
        aperture_m=receiver.aperture_m,
    )
    photons = optics.collect(hits, laser, receiver, late_s)
    reading, waveforms = detector.detect(photons, lidar.detector, rng)
    labels = scene.label(hits, photons, lidar.max_returns)
    measured = truth.pointing.measured_rad if truth.pointing else None
    observation = Observation(truth.time_s, reading, lidar.settings, receiver.line_of_sight, measured)
    made: dict[str, Record | None] = {"rays": rays, "hits": hits, "photons": photons, "waveforms": waveforms}
    if "oversampled" in keep:
        made["oversampled"] = optics.oversampled(hits, laser, receiver)
    kept = {name: record for name in keep if (record := made[name]) is not None}
    return Frame(index, observation, labels, truth, scenario.source, kept)


def frame_numbers(scenario: Scenario, frames: slice | Iterable[int] | None) -> np.ndarray:
    """Return the numbers of the frames that `frames` chooses, or raise `ScenarioError`."""
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
        raise ScenarioError(f"frames: need rising numbers from 0 to {n_frames - 1}")
    return numbers


def _known(keep: Iterable[str], scenario: Scenario) -> tuple[str, ...]:
    names = (keep,) if isinstance(keep, str) else tuple(keep)
    for name in names:
        if name not in KEPT:
            raise ScenarioError(f"keep: no intermediate record '{name}'; known: {', '.join(KEPT)}")
    if "waveforms" in names and scenario.lidar.detector.type != "gsfl":
        raise ScenarioError(
            f'keep: the detector "{scenario.lidar.detector.type}" has no waveforms; set lidar.detector.type = "gsfl"'
        )
    return names
