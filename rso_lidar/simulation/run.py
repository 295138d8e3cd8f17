"""A run of a scenario: all its flashes in order, with a controller or without."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from rso_lidar.errors import ScenarioError
from rso_lidar.processes import call_in_background
from rso_lidar.records import Command, Frame, Labels, Reading, Record
from rso_lidar.scenario import Scenario, require_scenario
from rso_lidar.simulation.first_start import compile_ahead
from rso_lidar.simulation.laser_flash import assemble_frame, check_kept, flash
from rso_lidar.simulation.stepping import Moment, Simulation, check_count
from rso_lidar.track import Controller


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
    scenario : to be simulated
    controller : called with each frame's Observation. The Command that it returns acts from the next flash on
    frames : indices of frames to make, ascending, or a slice (None: all). Frame k depends on scenario, seed and k
        only. Under a controller it depends on history, so the two cannot be combined
    threads : number of threads (None: one per core). The result is bit for bit the same
    workers : number of processes that make frames, instead of threads, for machines with many cores. A script that
        uses them needs ``if __name__ == "__main__":`` around its own code. The result is bit for bit the same
    keep : names of intermediate records to leave in ``frame.kept``: rays, hits, signal, photons, taps, waveforms,
        oversampled, prediction. ``signal`` is the photons without stray light, which the labels describe. ``taps`` holds the
        signals between the stages of the detector, ``prediction`` the probability and the scatter of each pixel's report

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
    check_count("workers", workers)
    if threads is not None and workers is not None:
        raise ScenarioError("simulate: frames are made by threads or by workers; leave out one")
    if controller is not None and not callable(controller):
        raise ScenarioError(f"simulate: a controller is called with each Observation; {controller!r:.60} cannot be")
    if controller is not None and frames is not None:
        raise ScenarioError("simulate: frames depend on history with a controller; leave out frames or the controller")
    if controller is not None and workers is not None:
        raise ScenarioError("simulate: under a controller each frame waits for the one before; leave out workers")
    require_scenario(scenario, "simulate")
    chosen: dict[str, Any] = {"threads": threads, "keep": check_kept(keep, scenario)}
    if controller is not None:
        return _fly_controlled(scenario, controller, **chosen)
    scenario.time.choose_frames(frames)  # frames that do not exist are an error now, and not at the first frame
    return _fly(scenario, workers, frames=frames, **chosen)


def _fly_controlled(scenario: Scenario, controller: Controller, **chosen: Any) -> Iterator[Frame]:
    """Yield the frames of a run under a controller.

    Parameters
    ----------
    chosen : further arguments of `Simulation`
    """
    simulation = Simulation(scenario, **chosen)
    command: Command | None = None
    while not simulation.is_over:
        frame = simulation.step(command)
        yield frame
        command = controller(frame.observation)  # the only feedback there is
        if command is not None and not isinstance(command, Command):
            raise ScenarioError(f"simulate: the controller returned {command!r:.60}; it returns a Command or None")


def _fly(scenario: Scenario, workers: int | None, **chosen: Any) -> Iterator[Frame]:
    """Yield the frames of a run without commands. They are made in parallel, and ahead of the one requested.

    Parameters
    ----------
    workers : number of processes that make frames; None for threads
    chosen : further arguments of `Simulation`
    """
    simulation = Simulation(scenario, commanded=False, **chosen)
    at_once, ahead = (workers, 2 * workers) if workers else (simulation.threads, simulation.threads)
    if simulation.threads > 1 and not workers:
        compile_ahead()
    flashes: deque[Callable[[], Frame]] = deque()
    with _flash_in_parallel(scenario, at_once, in_processes=workers is not None) as begin:
        while not simulation.is_over:
            flashes.append(begin(simulation.advance(), keep=simulation.keep))
            if len(flashes) > ahead:
                yield flashes.popleft()()
        while flashes:
            yield flashes.popleft()()


@contextmanager
def _flash_in_parallel(
    scenario: Scenario, count: int, *, in_processes: bool
) -> Iterator[Callable[..., Callable[[], Frame]]]:
    """Yield a function that starts a flash in the background and returns a function that waits for its frame."""
    call = partial(_make_part if in_processes else flash, scenario)
    with call_in_background(call, count, in_processes=in_processes) as start:

        def begin(moment: Moment, keep: tuple[str, ...]) -> Callable[[], Frame]:
            chosen = {"lidar": moment.lidar, "index": moment.index, "keep": keep}
            if not in_processes:
                return start(moment.truth, moment.rng, 1, sensors=moment.sensors, **chosen)
            wait = start(moment.truth, moment.rng, 1, **chosen)

            def finish() -> Frame:
                reading, labels, kept = wait()
                of = scenario, moment.truth, moment.lidar, moment.index
                return assemble_frame(*of, reading, labels, kept, moment.sensors)

            return finish

        yield begin


def _make_part(*given: Any, **chosen: Any) -> tuple[Reading, Labels, dict[str, Record]]:
    """Make a frame and return what only it holds: the rest need not travel between processes."""
    frame = flash(*given, **chosen)
    return frame.observation.reading, frame.labels, dict(frame.kept)
