"""A run of a scenario: all its flashes in order, with a controller or without."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.processes import SentFunction, check_workers, open_executor, send_function
from rso_lidar.records import CameraImage, CameraLabels, Command, Frame, Labels, Reading, Record
from rso_lidar.scenario import Scenario, require_scenario
from rso_lidar.simulation.first_start import compile_ahead
from rso_lidar.simulation.laser_flash import assemble_frame, check_kept, flash
from rso_lidar.simulation.stepping import Moment, Simulation, check_count
from rso_lidar.track import Controller, FastController
from rso_lidar.units import NS_PER_S

_SAME_PERIOD = 1e-3  # of the time between commands: an instant rounded to 1 ns belongs to the command due then


def simulate(
    scenario: Scenario,
    controller: Controller | None = None,
    *,
    frames: slice | Iterable[int] | None = None,
    threads: int | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    keep: Iterable[str] = (),
    command_rate_hz: float | None = None,
) -> Iterator[Frame]:
    """Simulate a scenario and yield one frame per laser flash.

    Parameters
    ----------
    scenario : to be simulated
    controller : called with each frame's Observation. The Command that it returns acts from the next flash on
    frames : indices of frames to make, ascending, or a slice (None: all). Frame k depends on scenario, seed and k
        only. Under a controller it depends on history, so the two cannot be combined
    threads : number of threads (None: one per core). The result is bit for bit the same
    workers : number of processes that make frames, instead of threads, for machines with many cores. A script that
        uses them needs ``if __name__ == "__main__":`` around its own code. The result is bit for bit the same
    executor : in the manner of `concurrent.futures`, whose workers make frames in place of `workers`: a pool of threads or
        processes, or ``client.get_executor()`` of dask. The result is bit for bit the same
    keep : names of intermediate records to leave in ``frame.kept``: rays, hits, signal, photons, taps, waveforms,
        oversampled, prediction. ``signal`` is the photons without stray light, which the labels describe. ``taps`` holds the
        signals between the stages of the detector, ``prediction`` the probability and the scatter of each pixel's report
    command_rate_hz : rate of commands between the flashes [Hz], from t = 0, of a controller that is a `FastController`
        (None: one command for each flash)

    Yields
    ------
    Frame
        In the order of the indices.

    Raises
    ------
    ScenarioError
        If the arguments contradict each other, or the scenario cannot be simulated.
    """
    check_count("threads", threads)
    check_workers(workers, executor)
    if threads is not None and (workers is not None or executor is not None):
        raise ScenarioError("simulate: frames are made by threads or by workers; leave out one")
    if controller is not None and not callable(controller):
        raise ScenarioError(f"simulate: a controller is called with each Observation; {controller!r:.60} cannot be")
    if controller is not None and frames is not None:
        raise ScenarioError("simulate: frames depend on history with a controller; leave out frames or the controller")
    if controller is not None and (workers is not None or executor is not None):
        raise ScenarioError("simulate: under a controller each frame waits for the one before; leave out workers")
    require_scenario(scenario, "simulate")
    period_ns = _check_rate(command_rate_hz, controller)
    chosen: dict[str, Any] = {"threads": threads, "keep": check_kept(keep, scenario)}
    if controller is not None:
        return _fly_controlled(scenario, controller, period_ns, **chosen)
    scenario.time.choose_frames(frames)  # frames that do not exist are an error now, and not at the first frame
    return _fly(scenario, workers, executor, frames=frames, **chosen)


def _check_rate(rate_hz: float | None, controller: Controller | None) -> float | None:
    """Return the time between commands [ns], or None for one command for each flash."""
    if rate_hz is None:
        return None
    if not isinstance(rate_hz, int | float) or isinstance(rate_hz, bool) or not 1e-6 <= rate_hz <= 1e6:
        raise ScenarioError(f"command_rate_hz: {rate_hz!r:.40} is no rate; give Hz from 1e-6 to 1e6")
    if not isinstance(controller, FastController):
        raise ScenarioError(
            f"command_rate_hz: the controller {controller!r:.60} has no method command_at(time_s, samples); add it, or "
            "leave the rate out"
        )
    return NS_PER_S / rate_hz


def _fly_controlled(
    scenario: Scenario, controller: Controller, period_ns: float | None, **chosen: Any
) -> Iterator[Frame]:
    """Yield the frames of a run under a controller.

    Parameters
    ----------
    period_ns : time between commands [ns]; None for one command for each flash
    chosen : further arguments of `Simulation`
    """
    simulation = Simulation(scenario, **chosen)
    command: Command | None = None
    while not simulation.is_over:
        frame = simulation.step(command)
        yield frame
        command = _check_command(controller(frame.observation))  # the only feedback there is
        while period_ns is not None and (next_s := simulation.next_flash_s) is not None:
            now_ns = round(simulation.time_s * NS_PER_S)
            due_ns = round((math.floor(now_ns / period_ns + _SAME_PERIOD) + 1) * period_ns)
            if due_ns >= round(next_s * NS_PER_S):
                break
            simulation.step(command, dt_s=(due_ns - now_ns) / NS_PER_S)
            assert isinstance(controller, FastController)
            command = _check_command(controller.command_at(simulation.time_s, simulation.samples))


def _check_command(command: Command | None) -> Command | None:
    """Return what a controller returned if it is a command or None."""
    if command is not None and not isinstance(command, Command):
        raise ScenarioError(f"simulate: the controller returned {command!r:.60}; it returns a Command or None")
    return command


def _fly(scenario: Scenario, workers: int | None, executor: Executor | None, **chosen: Any) -> Iterator[Frame]:
    """Yield the frames of a run without commands. They are made in parallel, and ahead of the one requested.

    Parameters
    ----------
    workers, executor : as for `simulate`; threads make the frames without both
    chosen : further arguments of `Simulation`
    """
    simulation = Simulation(scenario, commanded=False, **chosen)
    flashes: deque[Callable[[], Frame]] = deque()
    with ExitStack() as stack:
        by = stack.enter_context(open_executor(workers, executor=executor))
        if by is None:
            by = stack.enter_context(ThreadPoolExecutor(simulation.threads))
            if simulation.threads > 1:
                compile_ahead()
        in_thread = isinstance(by, ThreadPoolExecutor)
        sent = stack.enter_context(send_function(partial(flash if in_thread else _make_part, scenario), by))
        ahead = sent.slots if in_thread else 2 * sent.slots - 1  # at most two frames for each worker wait or are made
        while not simulation.is_over:
            flashes.append(_begin(sent, scenario, simulation.keep, simulation.advance(), in_thread=in_thread))
            if len(flashes) > ahead:
                yield flashes.popleft()()
        while flashes:
            yield flashes.popleft()()


def _begin(
    sent: SentFunction, scenario: Scenario, keep: tuple[str, ...], moment: Moment, *, in_thread: bool
) -> Callable[[], Frame]:
    """Begin a flash by a worker, and return a function that waits for its frame."""
    chosen = {"lidar": moment.lidar, "index": moment.index, "keep": keep}
    if in_thread:
        return partial(sent.result, sent.submit(moment.truth, moment.rng, 1, sensors=moment.sensors, **chosen))
    future = sent.submit(moment.truth, moment.rng, 1, **chosen)

    def finish() -> Frame:
        reading, labels, kept, images = sent.result(future)
        of = scenario, moment.truth, moment.lidar, moment.index
        return assemble_frame(*of, reading, labels, kept, moment.sensors, images)

    return finish


def _make_part(
    *given: Any, **chosen: Any
) -> tuple[Reading, Labels, dict[str, Record], dict[str, tuple[CameraImage, CameraLabels]]]:
    """Make a frame and return what only it holds: the rest need not travel between processes."""
    frame = flash(*given, **chosen)
    images = {name: (image, frame.camera_labels[name]) for name, image in frame.camera.items()}
    return frame.observation.reading, frame.labels, dict(frame.kept), images
