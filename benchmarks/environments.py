"""Environments side by side: in one process that shares its scenario, and in as many processes."""

import json
import resource
import subprocess
import sys
import time

import numpy as np

from benchmarks.report import Findings, Target, table

NAME = "rso_lidar.loop.environments:rso_lidar/PointAndTrack-v0"
WAYS = ("one process, threads", "one process, in turn", "as many processes")
WANTED = 5.0  # times the steps of as many processes


def run(*, quick: bool) -> Findings:
    """Return steps per second of each way, start and memory, and the ratio of one process to as many."""
    count, steps, rounds = (4, 10, 1) if quick else (16, 40, 3)
    rates: dict[str, list[float]] = {way: [] for way in WAYS}
    rows, last = [], {}
    for _ in range(rounds):  # in turns
        for way in WAYS:
            print(f"environments: {way}", file=sys.stderr)
            command = [sys.executable, "-m", "benchmarks.environments", way, str(count), str(steps)]
            last[way] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            rates[way].append(last[way]["steps_per_s"])
    for way in WAYS:
        row = last[way]
        rows.append(
            (
                way,
                f"{np.median(rates[way]):.0f}",
                f"{row['cpu_ms']:.2f}",
                f"{row['start_s']:.1f}",
                f"{row['memory_mib']:,.0f}",
            )
        )
    ratio = float(np.median(np.array(rates[WAYS[0]]) / np.array(rates[WAYS[2]])))
    header = (f"{count} environments by", "steps/s", "CPU of a step [ms]", "start [s]", "memory at the end [MiB]")
    target = Target(
        "vector environments in one process",
        f"{WANTED:g} times the steps per second of as many processes",
        f"{ratio:.2f} times",
        ratio >= WANTED,
    )
    return Findings({"environments": table(header, rows)}, [target])


def measure(way: str, count: int, steps: int) -> dict[str, float]:
    """Return steps per second, processor time of a step, time to the first observations, and memory.

    Parameters
    ----------
    way : of `WAYS`.
    count : number of environments.
    steps : number of steps of each.
    """
    import gymnasium

    begin_s = time.perf_counter()
    chosen = {
        WAYS[0]: {"vectorization_mode": "vector_entry_point"},
        WAYS[1]: {"vectorization_mode": "sync"},
        WAYS[2]: {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn"}},
    }[way]
    envs = gymnasium.make_vec(NAME, num_envs=count, **chosen)
    envs.reset(seed=1)
    start_s = time.perf_counter() - begin_s
    still = np.zeros(envs.action_space.shape, dtype=np.float32)
    for _ in range(3):  # warm-up
        envs.step(still)
    pids = [process.pid for process in getattr(envs, "processes", [])]
    before_s, begin_s = read_cpu_s(pids), time.perf_counter()
    for _ in range(steps):
        envs.step(still)
    took_s = time.perf_counter() - begin_s
    cpu_s = read_cpu_s(pids) - before_s
    memory_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 + sum(map(read_memory_mib, pids))
    envs.close()
    done = count * steps
    return {"steps_per_s": done / took_s, "cpu_ms": 1e3 * cpu_s / done, "start_s": start_s, "memory_mib": memory_mib}


def read_cpu_s(pids: list[int]) -> float:
    """Return the processor time of this process and of others [s], as Linux counts it."""
    return time.process_time() + sum(time.clock_gettime((~pid << 3) | 2) for pid in pids)


def read_memory_mib(pid: int) -> float:
    """Return the memory of a process that it does not share [MiB], from /proc (Linux)."""
    with open(f"/proc/{pid}/smaps_rollup", encoding="utf-8") as lines:  # noqa: PTH123
        return sum(int(line.split()[1]) for line in lines if line.startswith("Private_")) / 1024


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
