"""How fast rso_lidar is: ``python -m benchmarks`` measures, prints, and writes docs/performance.md. Nothing is asserted.

Machines differ and are shared, so the figures to compare are ratios, taken in turns in one run.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks import (
    cameras,
    dataset,
    environments,
    footprint,
    growth,
    labelled,
    loop,
    orbit,
    peers,
    report,
    sampling,
    stages,
    startup,
    studio,
    workers,
)
from benchmarks.report import HEADER, Findings, table

PARTS = (
    "stages",
    "sampling",
    "peers",
    "dataset",
    "labelled",
    "cameras",
    "workers",
    "startup",
    "loop",
    "environments",
    "growth",
    "orbit",
    "footprint",
    "studio",
)


def main() -> None:
    """Measure what is asked for, and tell."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer repeats and a tenth of the dataset: a first look")
    parser.add_argument(
        "--only", nargs="+", choices=PARTS, default=PARTS, metavar="PART", help=f"of {', '.join(PARTS)}; all by default"
    )
    parser.add_argument("--write", type=Path, metavar="PAGE", help="put the tables between the markers of a page")
    parser.add_argument(
        "--frames", type=int, metavar="N", help=f"so many in growth ({growth.FRAMES:,}) and orbit ({orbit.FRAMES:,})"
    )
    chosen = parser.parse_args()
    if chosen.write and not chosen.write.is_file():  # before minutes of measuring
        parser.error(
            f"--write {chosen.write}: there is no such page; give one with markers, such as docs/performance.md"
        )
    if chosen.frames is not None and chosen.frames < 1:
        parser.error(f"--frames {chosen.frames}: give 1 or more")
    pictures = chosen.write.parent / "pictures" if chosen.write else None
    runs: dict[str, Callable[[], Findings]] = {
        "stages": lambda: stages.run(quick=chosen.quick),
        "sampling": lambda: sampling.run(quick=chosen.quick),
        "peers": lambda: peers.run(quick=chosen.quick),
        "dataset": lambda: dataset.run(quick=chosen.quick),
        "labelled": lambda: labelled.run(quick=chosen.quick),
        "cameras": lambda: cameras.run(quick=chosen.quick),
        "workers": lambda: workers.run(quick=chosen.quick),
        "startup": lambda: startup.run(quick=chosen.quick),
        "loop": lambda: loop.run(quick=chosen.quick),
        "environments": lambda: environments.run(quick=chosen.quick),
        "growth": lambda: growth.run(quick=chosen.quick, frames=chosen.frames, pictures=pictures),
        "orbit": lambda: orbit.run(quick=chosen.quick, frames=chosen.frames),
        "footprint": lambda: footprint.run(quick=chosen.quick),
        "studio": lambda: studio.run(quick=chosen.quick),
    }
    print(report.machine())
    found = Findings()
    for part in (name for name in PARTS if name in chosen.only):
        start = time.monotonic()
        made = runs[part]()
        found.blocks |= made.blocks
        found.targets += made.targets
        for block in made.blocks.values():
            print(f"\n{block}")
        print(f"({part}: {time.monotonic() - start:.0f} s)", file=sys.stderr)
        if chosen.write:
            report.write(chosen.write, part, Findings({"machine": report.machine(), **made.blocks}, made.targets))
    if found.targets:
        print(f"\n{table(HEADER, [target.row for target in found.targets], left=2)}")


if __name__ == "__main__":
    main()
