"""`rso-lidar serve`: a simulation behind a socket, for flight software in another process."""

import os
import signal
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from rso_lidar import interruption
from rso_lidar.cli.arguments import Overwrite, ScenarioFile, Seed, Settings, Threads, TrustCode, TrustFmu, join_settings
from rso_lidar.cli.live_options import Live, LiveAt, LiveOrigin, LiveWith, open_live_view, report_live_view
from rso_lidar.cli.progress import announce_compiling
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import ScenarioError
from rso_lidar.loop import (
    Deadlines,
    FlightRecorder,
    Security,
    Server,
    Session,
    import_zmq,
    read_token,
)
from rso_lidar.scenario import Scenario
from rso_lidar.simulation import Simulation

_TOKEN = "RSO_LIDAR_TOKEN"


def serve(
    file: ScenarioFile,
    bind: Annotated[
        str, typer.Option("--bind", metavar="ADDRESS", help="Address of the requests; with port * a free one.")
    ] = "tcp://127.0.0.1:5571",
    publish: Annotated[
        str | None, typer.Option("--publish", metavar="ADDRESS", help="Publish every reading at this address, too.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Record all frames, with truth and labels (.h5, or .nc).")
    ] = None,
    real_time: Annotated[
        float | None,
        typer.Option("--real-time", metavar="FACTOR", help="Keep to the wall clock: 1 is real time, 2 twice as fast."),
    ] = None,
    late: Annotated[
        str,
        typer.Option(
            "--late",
            metavar="POLICY",
            help="At a missed deadline: slip the later ones, skip flashes to catch up, or fail.",
            autocompletion=lambda: list(Deadlines.POLICIES),
        ),
    ] = "slip",
    truth: Annotated[bool, typer.Option("--truth", help="Answer requests for the truth.")] = False,
    token_file: Annotated[
        Path | None,
        typer.Option("--token-file", metavar="FILE", help=f"File of the token that clients need; else {_TOKEN}."),
    ] = None,
    curve_key: Annotated[
        Path | None,
        typer.Option("--curve-key", metavar="FILE", help="CURVE keys of the server, a file .key_secret of zmq.auth."),
    ] = None,
    curve_clients: Annotated[
        Path | None,
        typer.Option("--curve-clients", metavar="FOLDER", help="Folder of the public keys of clients (.key)."),
    ] = None,
    seed: Seed = None,
    threads: Threads = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
    live: Live = False,
    live_at: LiveAt = None,
    live_with: LiveWith = None,
    live_origin: LiveOrigin = None,
) -> None:
    """Serve a simulation to flight software in another process. It ends on a signal, or when a client shuts it down."""
    import_zmq("serve")
    token = read_token(token_file) if token_file else os.environ.get(_TOKEN) or None
    security = Security(token, curve_key, curve_clients)
    if late not in Deadlines.POLICIES:
        raise ScenarioError(f"--late {late}: is not {', '.join(Deadlines.POLICIES)}")
    deadlines = None if real_time is None else Deadlines(real_time, late)
    scenario = Scenario.load(file, join_settings(settings, seed), trust_code=trust_code, trust_fmu=trust_fmu)
    recorder = FlightRecorder(output, overwrite=overwrite) if output else None
    signals: list[int] = []
    with ExitStack() as undone:
        simulation = undone.enter_context(Simulation(scenario, threads=threads))
        view = open_live_view(scenario, live, live_at, live_with, live_origin)
        show = undone.enter_context(view).show if view else None
        session = Session(simulation, serves_truth=truth, recorder=recorder, show=show)
        server = undone.enter_context(
            Server(session, bind, publish=publish, security=security, deadlines=deadlines, log=echo)
        )
        with announce_compiling():
            simulation.step()  # compiles before the first request
        simulation.reset()
        stream = f"; readings at {server.stream}" if server.stream else ""
        echo(f"serving     {scenario.name} at {server.endpoint}{stream}")
        try:
            with interruption.take_first_signal(signals.append):
                server.run(lambda: bool(signals))
        finally:
            _report(recorder, deadlines)
    report_live_view(view)
    if signals:
        if signals[0] != signal.SIGINT:
            echo(interruption.format_ending(signals[0]), err=True)
        raise typer.Exit(128 + signals[0])


def _report(recorder: FlightRecorder | None, deadlines: Deadlines | None) -> None:
    """Complete the recording, and print what was recorded and how the deadlines were kept."""
    if recorder is not None:
        recorder.complete()
        for path, count in recorder.completed:
            echo(f"recorded    {path} ({count} frame{'s' * (count != 1)})")
    for line in deadlines.report() if deadlines else ():
        echo(line)
