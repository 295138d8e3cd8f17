"""`rso-lidar dataset make`: a dataset from its specification, shard by shard."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from rso_lidar import dataset
from rso_lidar.cli.arguments import Engine, Scheduler, TrustCode, TrustFmu, choose_scheduler
from rso_lidar.cli.progress import Bar, announce_compiling, show_progress
from rso_lidar.cli.terminal import echo, to_one_line
from rso_lidar.errors import DatasetError
from rso_lidar.interruption import set_advice


def make(
    spec: Annotated[Path, typer.Argument(metavar="SPEC", help="Specification of the dataset (TOML).")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FOLDER", help="Folder of the dataset.")],
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            min=1,
            max=256,
            help="Number of processes (default: one per core); does not change the bytes of the dataset.",
        ),
    ] = None,
    engine: Engine = "pool",
    scheduler: Scheduler = None,
    shards: Annotated[
        str | None,
        typer.Option(
            "--shards",
            metavar="A:B|I/N",
            help="Make only shards A to B - 1, or part I of N equal parts, from 0, such as in one task of an array job.",
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue a folder that was begun before.")] = False,
    trust_code: TrustCode = False,
    trust_fmu: TrustFmu = False,
) -> None:
    """Make a dataset: frames with labels in HDF5 shards, split for training and test.

    A run that is interrupted loses at most the shards that it was making; --resume goes on.
    """
    by = choose_scheduler(engine, scheduler, DatasetError)
    set_advice(lambda: to_one_line(f"finished shards are kept in {output}; the same command with --resume goes on"))
    with ExitStack() as stack:
        bars: list[Bar] = []

        def show(done: int, count: int) -> None:
            if not bars:
                stack.enter_context(announce_compiling())
                bars.append(stack.enter_context(show_progress(count, done, "making", of="shard")))
            else:
                bars[0].advance()

        new_dataset = dataset.make(
            spec,
            output,
            workers=workers,
            scheduler=by,
            shards=shards,
            resume=resume,
            on_shard=show,
            trust_code=trust_code,
            trust_fmu=trust_fmu,
        )
    for name in new_dataset.splits:
        split = new_dataset.split(name)
        echo(f"{name:6} {len(split):9,} frames, shards: {len(split.records):,}")
    n_made = sum(record.samples for record in new_dataset.records)
    if n_made == new_dataset.spec.n_samples:  # complete, not only some shards
        for line in dataset.publish(output):
            echo(line)
    echo(str(output))
