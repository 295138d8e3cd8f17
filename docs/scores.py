"""Score reference controllers and random agents in the environments: ``python docs/scores.py`` writes docs/gymnasium.md.

It flies 40 episodes of each environment, which takes a minute on one core, and replaces what stands between
``<!-- scores -->`` and ``<!-- end of scores -->``. Speed and memory are those of the machine on which it runs.
"""

from __future__ import annotations

import importlib.util
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import rso_lidar as rl
from rso_lidar.loop.environments.registration import register_environments

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "gymnasium.md"
BEGIN, END = "<!-- scores -->", "<!-- end of scores -->"
SEEDS = range(20)
MEMORY_STEPS = 10_000
# Linux counts in KiB, macOS in bytes.
PEAK_UNIT = 1 if sys.platform == "darwin" else 1024


def load_hold() -> Callable[[], rl.track.Controller]:
    """Return the class of the controller in examples/thrusters.py."""
    spec = importlib.util.spec_from_file_location("thrusters", ROOT / "examples" / "thrusters.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Hold


REFERENCES = {
    "rso_lidar/PointAndTrack-v0": (
        "`rl.track.Pointing(gate_m=20, lead_s=0.16)`",
        lambda: rl.track.Pointing(gate_m=20.0, lead_s=0.16),
    ),
    "rso_lidar/Approach-v0": ("`Hold` of `examples/thrusters.py`", load_hold()),
}


def fly(env: gymnasium.Env[Any, Any], seed: int, controller: rl.track.Controller | None) -> tuple[float, int]:
    """Fly an episode and return the sum of its rewards and the number of its steps.

    Parameters
    ----------
    env : the environment.
    seed : of the episode, and of the random actions.
    controller : called with each observation; None for random actions.
    """
    env.reset(seed=seed)
    env.action_space.seed(seed)
    bare: Any = env.unwrapped
    score, steps, is_over = 0.0, 0, False
    while not is_over:
        action = (
            env.action_space.sample() if controller is None else bare.to_action(controller(bare.simulation.observation))
        )
        _, reward, is_terminated, is_truncated, _ = env.step(action)
        score, steps, is_over = score + float(reward), steps + 1, is_terminated or is_truncated
    return score, steps


def peak_mib() -> float:
    """Return the greatest resident memory of this process so far [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * PEAK_UNIT / 2**20


def measure_memory(name: str) -> tuple[float, float]:
    """Return the peak of resident memory after a tenth of `MEMORY_STEPS`, and its growth in the rest [MiB]."""
    env = gymnasium.make(name)
    _, make_controller = REFERENCES[name]
    steps, seed, first = 0, 1000, None
    while steps < MEMORY_STEPS:
        steps += fly(env, seed, make_controller())[1]
        seed += 1
        if first is None and steps >= MEMORY_STEPS // 10:
            first = peak_mib()
    return first, peak_mib() - first


def write_table() -> str:
    """Return the table of scores, speed and memory."""
    register_environments()
    lines = [
        "| environment | agent | score | least to greatest | steps of an episode |",
        "| --- | --- | --- | --- | --- |",
    ]
    costs = []
    for name, (title, make_controller) in REFERENCES.items():
        env = gymnasium.make(name)
        fly(env, 0, None)  # compiles the inner loops
        for agent, make in ((title, make_controller), ("random actions", lambda: None)):
            begin_s = time.process_time()
            scores, steps = np.transpose([fly(env, seed, make()) for seed in SEEDS])
            if make is make_controller:
                speed = steps.sum() / (time.process_time() - begin_s)
            lines.append(
                f"| `{name}` | {agent} | {scores.mean():.1f} ± {scores.std(ddof=1):.1f} | {scores.min():.1f} to "
                f"{scores.max():.1f} | {steps.mean():.0f} |"
            )
        first, growth = measure_memory(name)
        costs.append(
            f"- `{name}`: {speed:.0f} steps per second of one core with the reference controller. Peak memory {first:.0f} "
            f"MiB after {MEMORY_STEPS // 10:,} steps, and {growth:.1f} MiB more after {MEMORY_STEPS:,}."
        )
    return "\n".join([*lines, "", *costs])


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    PAGE.write_text(f"{before}{BEGIN}\n\n{write_table()}\n\n{END}{after}", encoding="utf-8")
