"""Truth of the frames of a recording in batches, read without the images."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np

from rso_lidar.export.layout.datasets import INERTIAL, POINTING
from rso_lidar.export.reader.recording import Frames, Recording
from rso_lidar.export.writer.frame_stream import take_first
from rso_lidar.pose import Link, PoseTree
from rso_lidar.records import BodyState, Frame, PtuAngles, Source, Truth, specs

TruthBatch = tuple[Truth, tuple[PtuAngles, ...]]  # a batch of truth, and the PTU's angles at each of its instants
_READ = 1024  # frames per batch
_JOINED = 128  # frames kept, where they come one by one


def peek_source(path: Path, frames: Iterable[Frame]) -> tuple[Source, Iterable[Frame]]:
    """Return the source of frames, and the frames; of an iterator, the first frame is read.

    Parameters
    ----------
    path : of the output, for messages
    frames : a recording, frames of one, or frames as they come

    Raises
    ------
    RecordingError
        If there are no frames.
    """
    first, coming = take_first(path, frames)
    return first.source, frames if isinstance(frames, Recording | Frames) else coming


def read_truth_batches(frames: Iterable[Frame]) -> Iterator[TruthBatch]:
    """Yield the truth and the PTU angles in batches; of a recording, no image is read."""
    if isinstance(frames, Recording):
        frames = frames[:]
    if isinstance(frames, Frames):
        for low in range(0, len(frames), _READ):
            yield _read_batch(frames.recording, np.asarray(frames.places[low : low + _READ], dtype=int))
        return
    coming = iter(frames)
    while truths := [frame.truth for frame in itertools.islice(coming, _JOINED)]:
        yield _stack_truths(truths)


def _read_batch(recording: Recording, places: np.ndarray) -> TruthBatch:
    """Read the truth and the PTU angles of some frames of a recording."""
    from scipy.spatial.transform import Rotation

    known = recording[int(places[0])].truth  # what there is
    first, last = int(places.min()), int(places.max())

    def rows(path: str) -> np.ndarray:
        entries: np.ndarray = recording.read(path, slice(first, last + 1))[places - first]
        return entries

    def link(group: str) -> Link:
        matrix = Rotation.from_quat(rows(f"{group}/parent_quaternion")).as_matrix()
        where = rows(f"{group}/parent_position"), matrix
        return Link(where, rows(f"{group}/velocity"), rows(f"{group}/angular_velocity"))

    with recording.watched():
        truth = Truth(
            rows("time"),
            PoseTree(
                {name: known.poses.parent(name) for name in known.poses},
                {name: link(f"truth/{name}") for name in known.poses},
            ),
            {
                name: BodyState(**{field: rows(f"truth/{name}/{path}") for path, field in INERTIAL.items()})
                for name in known.states
            },
            rows("truth/sun_direction"),
            None,
            {name: rows(f"truth/{name}/sunlit") for name in known.sunlit},
        )
        if known.pointing is None:
            return truth, ()
        table = {name: np.zeros((places.size, 2)) for name in specs(PtuAngles)}
        for path, name, axis in POINTING:
            table[name][:, axis] = rows(path)
    return truth, tuple(PtuAngles(**{name: values[k] for name, values in table.items()}) for k in range(places.size))


def _stack_truths(truths: list[Truth]) -> TruthBatch:
    """Stack truths of single epochs into one batch, and return it with the PTU angles."""
    first = truths[0]

    def link(name: str) -> Link:
        links = [truth.poses[name] for truth in truths]
        where = np.stack([link.translation_m for link in links]), np.stack([link.matrix for link in links])
        rates = np.stack([link.angular_velocity_rad_s for link in links])
        return Link(where, np.stack([link.velocity_m_s for link in links]), rates)

    def state(name: str) -> BodyState:
        states = [truth.states[name] for truth in truths]
        return BodyState(np.stack([at.position_m for at in states]), np.stack([at.velocity_m_s for at in states]))

    poses = {name: link(name) for name in first.poses}
    truth = Truth(
        np.array([truth.time_s for truth in truths]),
        PoseTree({name: first.poses.parent(name) for name in first.poses}, poses),
        {name: state(name) for name in first.states},
        np.stack([truth.sun_direction for truth in truths]),
        None,
        {name: np.array([truth.sunlit[name] for truth in truths]) for name in first.sunlit},
    )
    return truth, tuple(truth.pointing for truth in truths if truth.pointing is not None)


def read_truth(frames: Iterable[Frame], choose: Callable[[int], np.ndarray] | None = None) -> Truth:
    """Read the truth of frames into one batch; of a recording, no image is read.

    Parameters
    ----------
    frames : a recording, frames of one, or frames as they come; at least one
    choose : takes the number of frames, and returns the indices (frame) of those to keep (None: all are kept)

    Returns
    -------
    Truth
        Batched over the frames kept, without the angles of a PTU.
    """
    truths = [truth for truth, _ in read_truth_batches(frames)]
    truth = truths[0]

    def join(arrays: Iterable[np.ndarray]) -> np.ndarray:
        joined = np.concatenate(list(arrays))
        return joined if choose is None else joined[choose(len(joined))]

    def link(name: str) -> Link:
        links = [truth.poses[name] for truth in truths]
        where = join(link.translation_m for link in links), join(link.matrix for link in links)
        return Link(
            where, join(link.velocity_m_s for link in links), join(link.angular_velocity_rad_s for link in links)
        )

    def state(name: str) -> BodyState:
        states = [truth.states[name] for truth in truths]
        return BodyState(join(state.position_m for state in states), join(state.velocity_m_s for state in states))

    return Truth(
        join(truth.time_s for truth in truths),
        PoseTree({name: truth.poses.parent(name) for name in truth.poses}, {name: link(name) for name in truth.poses}),
        {name: state(name) for name in truth.states},
        join(truth.sun_direction for truth in truths),
        None,
        {name: join(truth.sunlit[name] for truth in truths) for name in truth.sunlit},
    )
