"""The loop over a socket: what it adds to a frame of `simulate`, and how much of a flash's time a step takes."""

import multiprocessing
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection

import numpy as np

import rso_lidar as rl
from benchmarks import scenes
from benchmarks.clock import quartiles
from benchmarks.report import Findings, Target, table

WANTED_MS = 0.3  # over the socket, beside `simulate`
PACED = {"300 m, 20 Hz": (300.0, 20.0), "1 km, 100 Hz": (1000.0, 100.0)}


def scenario(range_m: float, rate_hz: float, frames: int) -> rl.Scenario:
    """Return a stage at a range, seen by the camera of Fuller et al. on a PTU."""
    made = scenes.single("rocket_body", range_m, frames)
    times = rl.Time(start_utc=scenes.START, duration_s=frames / rate_hz, frame_rate_hz=rate_hz)
    return made.replace(
        time=times, ptu=rl.Ptu(point=rl.FixedPoint(), response=rl.SecondOrder(natural_hz=4.0, damping=0.7))
    )


def _serve(connection: Connection, text: str, is_paced: bool) -> None:
    """Serve a scenario in a process of its own until a client shuts it down, in real time if it is paced."""
    session = rl.loop.Session(rl.Simulation(rl.Scenario.loads(text), threads=1))
    deadlines = rl.loop.Deadlines(1.0, "slip") if is_paced else None
    with rl.loop.Server(session, "tcp://127.0.0.1:*", deadlines=deadlines) as server:
        connection.send(server.endpoint)
        server.run()


@contextmanager
def connected(flown: rl.Scenario, *, is_paced: bool = False) -> Iterator[tuple[rl.loop.Client, Callable[[], float]]]:
    """Yield a client of a server in another process, and a clock of the processor time of both [s]."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, flown.source.scenario, is_paced))
    process.start()
    assert process.pid is not None
    clock = (~process.pid << 3) | 2  # Linux: the clock of the processor time of a process
    try:
        with rl.loop.Client(ours.recv()) as client:
            yield client, lambda: time.process_time() + time.clock_gettime(clock)
            client.shut_down()
    finally:
        process.join()


def decide(observation: rl.Observation) -> rl.Command:
    """Return a command that costs nothing to find."""
    return rl.Command(pan_rad=1e-3 * float(np.sin(observation.time_s)), tilt_rad=0.0)


def overheads_ms(flown: rl.Scenario, repeats: int) -> tuple[np.ndarray, float]:
    """Return the processor time that the socket adds to each frame [ms], in turns with `simulate`, and that of `simulate`.

    It is the time of both processes. They work one after the other, so it is also the time that a frame takes longer on a
    free machine, but for the hand-over between the processes (two of 20 us).
    """
    frames = flown.time.n_frames
    added, alone = [], []
    with connected(flown) as (client, clock):
        for _ in range(repeats + 1):  # the first turn warms up
            with rl.Simulation(flown, threads=1) as simulation:
                start_s = clock()
                frame = simulation.step()
                while not simulation.is_over:
                    frame = simulation.step(decide(frame.observation))
            middle_s = clock()
            client.reset()
            client.step()
            while not client.is_over:
                client.step(decide(client.observation))
            alone.append((middle_s - start_s) / frames)
            added.append((clock() - middle_s) / frames - alone[-1])
    return 1e3 * np.array(added[1:]), 1e3 * float(np.median(alone[1:]))


def missed_deadlines(flown: rl.Scenario) -> int:
    """Return how many flashes of a run on the wall clock, as with ``rso-lidar serve --real-time 1``, came too late."""
    with connected(flown, is_paced=True) as (client, _):
        for _ in range(3):  # warm-up
            client.step(rl.Command(pan_rad=0.0))
        client.reset()  # the clock starts again
        before = client.overruns
        client.step()
        while not client.is_over:
            client.step(decide(client.observation))
        return client.overruns - before


def run(*, quick: bool) -> Findings:
    """Return what the socket adds, and which share of the time between flashes a step takes."""
    rows, targets = [], []
    light = scenario(3000.0, 20.0, 20 if quick else 100)
    light = light.replace(
        lidar=light.lidar.replace(detector=rl.Empirical())
    )  # a short flash, and images of the same size
    added, alone = overheads_ms(light, 5 if quick else 25)
    rows.append(("the socket adds to a frame of 128 × 128 pixels [ms of processor time]", quartiles(added, ".3f")))
    rows.append(("a frame of `simulate` in the same run [ms]", f"{alone:.2f}"))
    targets.append(
        Target(
            "lock-step over the socket",
            f"adds at most {WANTED_MS:g} ms per frame",
            f"{np.median(added):.2f} ms of processor time",
            bool(np.median(added) <= WANTED_MS),
        )
    )
    for name, (range_m, rate_hz) in PACED.items():
        flown = scenario(range_m, rate_hz, 20 if quick else 400)
        with connected(flown) as (client, clock):
            for _ in range(3):  # warm-up
                client.step(rl.Command(pan_rad=0.0))
            client.reset()
            took = []
            client.step()
            while not client.is_over:
                start_s = clock()
                client.step(decide(client.observation))
                took.append((clock() - start_s) * rate_hz)
        rows.append((f"a step of one thread over the time between flashes, {name}", quartiles(np.array(took))))
        late = float(np.mean(np.array(took) > 1.0))
        targets.append(
            Target(
                f"held in real time: {name}",
                "under 1 % of steps longer than the time between flashes",
                f"{late:.1%}; a step takes {np.median(took):.0%} of it",
                late < 0.01,
            )
        )
        missed = missed_deadlines(flown)
        rows.append(
            (f"deadlines missed on the wall clock (`--real-time 1`), {name}", f"{missed} of {flown.time.n_frames}")
        )
    return Findings({"loop": table(("over the loopback", "median (quartiles)"), rows)}, targets)
