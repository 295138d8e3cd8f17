"""The frames that requirements need: simulated from a scenario, or read from a recording, each once."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from rso_lidar.errors import RecordingError, ScenarioError
from rso_lidar.evaluation import load_scenario, tracking
from rso_lidar.mission_analysis import fly_open_loop
from rso_lidar.records import Frame, compute_viewing_geometry
from rso_lidar.scenario import Scenario, find_target
from rso_lidar.simulation import simulate
from rso_lidar.study.trades.merits import CountedFrames, bounding_diagonal_m
from rso_lidar.study.trades.run_sums import FrameSums, sum_frame
from rso_lidar.study.verification.requirements_file import Requirement

Tables = list[dict[str, np.ndarray]]


class FlownFrames(ABC):
    """Frames of a scenario, of one or more runs: their sums, and what a tracker makes of them.

    `ready` is called after each frame that was simulated or read.
    """

    def __init__(self, scenario: Scenario, target: str | None, ready: Callable[[], None], n_runs: int = 1) -> None:
        """Start without frames."""
        self.n_runs = n_runs
        self.scenario, self.number = scenario, find_target(scenario, target, "requirements: target")
        self._ready = ready
        self._size_m = bounding_diagonal_m(scenario, self.number)
        self._sums: dict[tuple[int, int], FrameSums] = {}
        self._tracks: dict[tuple[bytes, bool], Tables] = {}

    @abstractmethod
    def select(self, requirement: Requirement) -> np.ndarray:
        """Return the indices of the frames that count for a requirement, or raise an error where there are none."""

    @abstractmethod
    def _fly(self, run: int, numbers: np.ndarray) -> Iterable[Frame]:
        """Yield the frames of a run."""

    @abstractmethod
    def _track(self, run: int, numbers: np.ndarray, *, poses: bool) -> dict[str, np.ndarray]:
        """Return the table of the tracker over the frames of a run, whose sums are kept in passing."""

    def count(self, requirements: Sequence[Requirement]) -> int:
        """Return the number of frames to simulate or read for some requirements, an estimate for a progress bar."""
        chosen = [self.select(requirement) for requirement in requirements if requirement.needs_frames]
        return self.n_runs * len(np.unique(np.concatenate(chosen))) if chosen else 0

    def prepare(self, requirements: Sequence[Requirement]) -> None:
        """Simulate or read all frames that some requirements need, trackers first, each frame once where possible."""
        for requirement in requirements:
            if follows_frames(requirement):
                self.tables(self.select(requirement), poses=needs_poses(requirement))
        chosen = [self.select(requirement) for requirement in requirements if requirement.needs_frames]
        if chosen:
            self.sums(np.unique(np.concatenate(chosen)))

    def sums(self, numbers: np.ndarray) -> list[FrameSums]:
        """Return the sums of frames of all runs."""
        for run in range(self.n_runs):
            missing = np.array([k for k in numbers.tolist() if (run, k) not in self._sums], dtype=int)
            if missing.size:
                for frame in self._fly(run, missing):
                    self._keep(run, frame)
        return [self._sums[run, k] for run in range(self.n_runs) for k in numbers.tolist()]

    def tables(self, numbers: np.ndarray, *, poses: bool) -> Tables:
        """Return the tables of the tracker, one for each run."""
        key = numbers.tobytes(), poses
        if key not in self._tracks:
            self._tracks[key] = [self._track(run, numbers, poses=poses) for run in range(self.n_runs)]
        return self._tracks[key]

    def _keep(self, run: int, frame: Frame) -> None:
        """Keep the sums of a frame."""
        self._sums[run, frame.index] = sum_frame(frame, self.number, self._size_m, self.scenario.finding.pixels)
        self._ready()


class SimulatedFrames(FlownFrames):
    """Frames of a scenario, simulated in open loop with its seed and the ones that follow it."""

    def __init__(
        self,
        scenario: Scenario,
        target: str | None,
        ready: Callable[[], None],
        seeds: int,
        threads: int | None,
        executor: Executor | None,
    ) -> None:
        """Start without frames."""
        super().__init__(scenario, target, ready, seeds)
        self._threads, self._executor = threads, executor
        self._range_m: np.ndarray | None = None

    def select(self, requirement: Requirement) -> np.ndarray:
        """Return the indices of the frames that count for a requirement, or raise `ScenarioError` where there are none."""
        numbers = requirement.numbers(self.scenario)
        if requirement.between_m is None:
            return numbers
        if self._range_m is None:
            truth = fly_open_loop(self.scenario, drive=False)[0]
            self._range_m = compute_viewing_geometry(truth, self.scenario.target[self.number].name).range_m
        return _choose_between(requirement, numbers, self._range_m[numbers], ScenarioError)

    def _of_run(self, run: int) -> Scenario:
        return self.scenario if run == 0 else self.scenario.replace(seed=self.scenario.seed + run)

    def _fly(self, run: int, numbers: np.ndarray) -> Iterable[Frame]:
        return simulate(self._of_run(run), frames=numbers.tolist(), threads=self._threads, executor=self._executor)

    def _track(self, run: int, numbers: np.ndarray, *, poses: bool) -> dict[str, np.ndarray]:
        scenario = self._of_run(run)
        flying = CountedFrames(scenario, numbers, self._threads, lambda frame: self._keep(run, frame), self._executor)
        name = scenario.target[self.number].name
        return tracking(flying, name, folder=scenario.folder, poses=poses).table


class RecordedFrames(FlownFrames):
    """Frames of a recording."""

    def __init__(
        self, frames: Sequence[Frame], target: str | None, ready: Callable[[], None], folder: Path | None
    ) -> None:
        """Start with the numbers of the frames."""
        if not len(frames):
            raise RecordingError("requirements: the recording has no frames; record some")
        super().__init__(load_scenario(frames[0].source, folder), target, ready)
        self._frames, self._folder = frames, folder
        stored = getattr(frames, "frame_index", None)
        self._index = np.array([frame.index for frame in frames]) if stored is None else np.asarray(stored[:])
        self._range_m: np.ndarray | None = None

    def select(self, requirement: Requirement) -> np.ndarray:
        """Return the indices of the frames that count for a requirement, or raise `RecordingError` where there are none."""
        recorded = self._index
        if requirement.frames is not None:
            recorded = recorded[np.isin(recorded, requirement.numbers(self.scenario))]
            if not recorded.size:
                raise RecordingError(
                    f"requirement {requirement.id}: frames: the recording holds none of them, but {self._index.size} from "
                    f"{self._index.min()} to {self._index.max()}; give some of those"
                )
        if requirement.between_m is None:
            return recorded
        if self._range_m is None:
            name = self.scenario.target[self.number].name
            lengths = [np.linalg.norm(frame.truth.pose("lidar", name).translation) for frame in self._frames]
            self._range_m = np.array(lengths)
        return _choose_between(requirement, recorded, self._range_m[np.isin(self._index, recorded)], RecordingError)

    def _places(self, numbers: np.ndarray) -> list[int]:
        return [int(k) for k in np.flatnonzero(np.isin(self._index, numbers))]

    def _fly(self, run: int, numbers: np.ndarray) -> Iterable[Frame]:
        return (self._frames[k] for k in self._places(numbers))

    def _track(self, run: int, numbers: np.ndarray, *, poses: bool) -> dict[str, np.ndarray]:
        some = _SomeFrames(self._frames, self._places(numbers))
        name = self.scenario.target[self.number].name
        return tracking(some, name, folder=self._folder, poses=poses, each=self._passing(run, some)).table

    def _passing(self, run: int, frames: Iterable[Frame]) -> Iterable[Frame]:
        """Yield frames and keep the sums of each."""
        for frame in frames:
            self._keep(run, frame)
            yield frame


class _SomeFrames(Sequence[Frame]):
    """Some frames of a recording, read when they are asked for."""

    def __init__(self, frames: Sequence[Frame], places: list[int]) -> None:
        self._frames, self._chosen = frames, places

    def __len__(self) -> int:
        return len(self._chosen)

    def __getitem__(self, index: Any) -> Any:
        return self._frames[self._chosen[index]]


def follows_frames(requirement: Requirement) -> bool:
    """Return whether a requirement needs a tracker that follows from frame to frame."""
    return requirement.what.kind == "tracking" or requirement.quantity == "tracker_error_m"


def needs_poses(requirement: Requirement) -> bool:
    """Return whether a requirement needs ICP."""
    return requirement.what.column.startswith("icp_")


def _choose_between(
    requirement: Requirement, numbers: np.ndarray, range_m: np.ndarray, error: type[ScenarioError | RecordingError]
) -> np.ndarray:
    """Return the frames whose true range [m] is within the limits of a requirement; raise `error` without any."""
    assert requirement.between_m is not None
    low, high = requirement.between_m
    chosen: np.ndarray = numbers[(range_m >= low) & (range_m <= high)]
    if not chosen.size:
        raise error(
            f"requirement {requirement.id}: between_m: no frame has its target at {low:g} to {high:g} m; the frames are at "
            f"{range_m.min():.1f} to {range_m.max():.1f} m"
        )
    return chosen
