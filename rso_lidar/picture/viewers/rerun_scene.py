"""A recording as a scene for the viewer Rerun: axes, clouds, images and true meshes over time, in one file (.rrd).

Rerun stores positions in float32, which resolves metres at the distance of an orbit. The scene's origin is therefore the
first target's, and the inertial root is left out.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rso_lidar.errors import RecordingError, RunError
from rso_lidar.files import write_atomically
from rso_lidar.interruption import make_temporary_folder
from rso_lidar.picture.selection.scale import Scale
from rso_lidar.picture.selection.sequence import Thumbnail, find_target_returns, pick
from rso_lidar.picture.selection.stretch import Stretch
from rso_lidar.picture.style.palette import DARK, NO_RETURN, OTHER_PART, split_rgb
from rso_lidar.picture.viewers.shape import Shape
from rso_lidar.pose import ROOT, PoseTree, quaternion_xyzw
from rso_lidar.records import Frame

Colour = Literal["range", "intensity"]
APPLICATION = "rso_lidar"
TIME, FRAME = "time", "frame"  # the two time lines: seconds since start_utc, and the frame's number
RANGE, INTENSITY, CAMERAS = "images/range", "images/intensity", "images/camera"
_COVER = "no_return"
_SHOWN_S = 20.0  # playing time of a recording longer than a minute
_LOOKED_AT = 24  # frames that the colour limits are computed from
_POINT = 2.5  # size of a point on the screen
_CONFIG = "XDG_CONFIG_HOME"
_HERE = "127.0.0.1"
_NOWHERE = f"http://{_HERE}:9"  # the discard port: analytics go nowhere


def has_rerun() -> bool:
    """Return whether the extra ``view`` is installed."""
    return find_spec("rerun") is not None


def import_rerun(what: str) -> Any:
    """Import rerun, which is an extra; raise `RecordingError` if the extra ``view`` is not installed."""
    try:
        import rerun
    except ImportError:
        raise RecordingError(
            f"{what}: Rerun is an extra: pip install rso-lidar[view], or choose a window or files"
        ) from None
    return rerun


def write_rerun(
    frames: Sequence[Frame],
    path: str | Path,
    shapes: Iterable[Shape] = (),
    *,
    colour: Colour = "range",
    each: Iterable[Frame] | None = None,
    cameras: Mapping[str, Sequence[float]] | None = None,
) -> Path:
    """Write a scene (.rrd) of some frames, frame by frame; a failed write leaves no file.

    Parameters
    ----------
    shapes : true meshes, each in axes that the truth knows
    colour : what the points' colour means, with one scale for all frames
    each : iterator over the same frames that counts them as they are read (None: `frames`)
    cameras : matrix of each camera beside the lidar by its name, nine numbers row by row [pixels], with (0, 0) at the
        centre of the first pixel (None: no cameras)

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    RecordingError
        If the extra ``view`` is not installed, or there are no frames.
    RunError
        If the file could not be written.
    """
    place = Path(path)
    rerun = import_rerun(str(place))
    thumbnails, _ = pick(frames, _LOOKED_AT, Thumbnail.of)
    lasts_s = thumbnails[-1].time_s - thumbnails[0].time_s
    scene = RerunScene(rerun, frames[0], lasts_s, tuple(shapes), Scale.of(thumbnails), colour, cameras)
    with write_atomically(place) as draft:
        stream = rerun.RecordingStream(APPLICATION, recording_id=_identity(frames[0]), send_properties=False)
        stream.save(draft, default_blueprint=scene.blueprint())
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        try:
            scene.begin(stream)
            for frame in frames if each is None else each:
                scene.add(stream, frame)
            _flush(stream, place)
        finally:
            stream.disconnect()
        _readable(draft, place)
    return place


def open_rerun(path: str | Path) -> None:
    """Show a scene (.rrd) in Rerun's viewer, and return when its window is closed.

    The viewer listens on this machine alone, and is given a way out that leads nowhere: it would look for newer versions
    and send usage data. On Linux a configuration of its own also tells it to collect none; elsewhere
    `rerun analytics disable` does.

    Raises
    ------
    RecordingError
        If the extra ``view`` is not installed.
    RunError
        If the viewer fails.
    """
    import_rerun(str(path))
    with silence_analytics() as environment:
        left = subprocess.run(viewer_command(path), env=environment, check=False)
    if left.returncode:
        raise RunError(
            f"{path}: Rerun's viewer left with status {left.returncode}; see `rerun --help`, or open a window"
        )


def viewer_command(path: str | Path) -> list[str]:
    """Return the command that shows a scene in a viewer of its own, on a port closed to other machines."""
    return [sys.executable, "-m", "rerun", "--bind", _HERE, "--port", "auto", os.fspath(path)]


@contextlib.contextmanager
def silence_analytics() -> Iterator[dict[str, str]]:
    """Provide an environment in which Rerun contacts no server and, on Linux, collects nothing."""
    with make_temporary_folder() as folder:
        config = Path(folder, "rerun", "analytics.json")
        config.parent.mkdir()
        config.write_text(
            json.dumps(
                {
                    "analytics_enabled": False,
                    "analytics_id": "",
                    "metadata": {},
                    "config_file_path": str(config),
                    "data_dir_path": str(config.parent),
                }
            ),
            encoding="utf-8",
        )
        yield {**os.environ, _CONFIG: folder, "HTTPS_PROXY": _NOWHERE, "https_proxy": _NOWHERE}


def _identity(frame: Frame) -> str:
    """Return a name of the recording that is the same whenever it is written."""
    import hashlib

    source = frame.source
    return hashlib.sha256(f"{source.scenario} {source.seed} {dict(source.versions)}".encode()).hexdigest()[:32]


def _flush(stream: Any, place: Path) -> None:
    """Wait until Rerun's writer thread has written everything, and raise if it failed."""
    try:
        stream.flush()
    except (RuntimeError, ValueError, OSError) as error:
        why = getattr(error, "strerror", None) or error
        raise RunError(f"{place}: could not be written ({why}); check the disk and run again") from None


def _readable(draft: Path, place: Path) -> None:
    """Check that a file is complete, up to the index at its end."""
    from rerun.chunk import RrdReader

    try:
        RrdReader(draft).store()
    except Exception as error:
        what = " ".join(str(error).split())[:120]
        raise RunError(f"{place}: could not be written ({what}); check the disk and run again") from None


def paths_of(poses: PoseTree, world: str) -> dict[str, list[str]]:
    """Return the scene path of each of the axes, by name: under its parent in the truth, or under the world.

    What hangs on the inertial root hangs on the world instead; the root itself is left out.

    Parameters
    ----------
    poses : tree of axes
    world : name of the scene's root axes, from `world_of`
    """
    paths = {world: [world]}
    for name in poses:
        chain = [name]
        while chain[-1] != world and poses.parent(chain[-1]) not in (ROOT, world):
            chain.append(poses.parent(chain[-1]))
        if chain[-1] != world:
            paths[name] = [world, *reversed(chain)]
    return paths


def world_of(frame: Frame) -> str:
    """Return the name of the root axes of a scene: non-rotating at the first target, or else at the follower."""
    poses = frame.truth.poses
    names = [entry.name for entry in frame.source.targets if entry.name in poses]
    names += [name for name in ("follower", "lidar") if name in poses]
    return poses.parent(names[0]) if names else ROOT


class RerunScene:
    """Scene being written: paths of its axes, scale of colours, meshes."""

    def __init__(
        self,
        rerun: Any,
        first: Frame,
        lasts_s: float,
        shapes: tuple[Shape, ...],
        scale: Scale,
        colour: Colour,
        cameras: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        """Prepare a scene for Rerun.

        Parameters
        ----------
        lasts_s : time between the first and last frame [s]
        cameras : as for `write_rerun`
        """
        self.cameras = cameras or {}
        self.rr, self.first, self.shapes, self.scale, self.colour = rerun, first, shapes, scale, colour
        self.world = world_of(first)
        self.paths = paths_of(first.truth.poses, self.world)
        known = [shape.radius_m for shape in shapes]
        if not known:  # no mesh: about the size of the returns, or a hundredth of the range
            known = [max(0.01 * float(np.linalg.norm(first.truth.pose(self.world, "lidar").translation)), 1e-3)]
        self.size_m = max(known)
        self.speed = max(1.0, round(lasts_s / _SHOWN_S)) if lasts_s > 60.0 else 1.0
        self.lens: tuple[float, int, int] | None = None

    def begin(self, stream: Any) -> None:
        """Write what does not change: style of the axes, meshes, and the up direction."""
        rr = self.rr
        stream.log(self.paths[self.world], rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        bodies = {shape.target for shape in self.shapes}
        for name, path in self.paths.items():
            share = 1.2 if name in bodies else 0.6 if name == self.world else 0.3
            stream.log(path, rr.TransformAxes3D(share * self.size_m), static=True)
        for shape in self.shapes:
            stream.log(
                [*self.paths[shape.axes], "mesh"],
                rr.Mesh3D(
                    vertex_positions=shape.corners_m.reshape(-1, 3).astype(np.float32),
                    vertex_normals=np.repeat(shape.normals, 3, axis=0).astype(np.float32),
                    albedo_factor=split_rgb(OTHER_PART),
                ),
                static=True,
            )
        for name, matrix in self.cameras.items():
            if name in self.first.camera:
                n_rows, n_cols, _ = self.first.camera[name].intensity_counts.shape
                from_corner = np.reshape(matrix, (3, 3)).copy()  # Rerun counts from the corner of the first pixel
                from_corner[:2, 2] += 0.5
                pinhole = rr.Pinhole(
                    image_from_camera=from_corner,
                    resolution=(n_cols, n_rows),
                    camera_xyz=rr.ViewCoordinates.RDF,
                    image_plane_distance=2.0 * self.size_m,
                )
                stream.log([*self.paths[name], "field"], pinhole, static=True)
        covered = [rr.AnnotationInfo(0, color=(0, 0, 0, 0)), rr.AnnotationInfo(1, "no return", split_rgb(NO_RETURN))]
        stream.log(f"{RANGE}/{_COVER}", rr.AnnotationContext(covered), static=True)
        source = self.first.source
        stream.log(
            "recording",
            rr.TextDocument(f"{source.title}\n\nstart {source.start_utc}, seed {source.seed}"),
            rr.AnyValues(scenario=source.scenario, start_utc=source.start_utc, world_axes=self.world),
            static=True,
        )

    def add(self, stream: Any, frame: Frame) -> None:
        """Write one frame.

        Parameters
        ----------
        frame : with the axes of the first one
        """
        rr, poses = self.rr, frame.truth.poses
        stream.set_time(TIME, duration=frame.time_s)
        stream.set_time(FRAME, sequence=frame.index)
        for name, path in self.paths.items():
            if name == self.world:
                continue
            parent = path[-2]
            parent_from = poses.pose(parent, name)
            turn = rr.Quaternion(xyzw=quaternion_xyzw(parent_from.rotation))
            stream.log(path, rr.Transform3D(translation=parent_from.translation, quaternion=turn))
        self._cloud(stream, frame)
        self._images(stream, frame)
        for name in self.cameras:
            if name in frame.camera:
                self._camera_image(stream, frame, name)

    def _cloud(self, stream: Any, frame: Frame) -> None:
        rr, lidar = self.rr, self.paths["lidar"]
        valid = frame.valid
        range_m, counts = frame.range_m[valid], frame.intensity_counts[valid]
        colours = (
            self.scale.range_rgb(range_m, _median_m(frame))
            if self.colour == "range"
            else self.scale.intensity_rgb(counts)
        )
        pixel = np.flatnonzero(valid).astype(np.int32)
        stream.log(
            [*lidar, "cloud"],
            rr.Points3D(frame.points_m[valid].astype(np.float32), colors=colours, radii=rr.Radius.ui_points(_POINT)),
            rr.AnyValues(drop_untyped_nones=False, range_m=range_m, intensity_counts=counts, pixel=pixel),
        )
        n_rows, n_cols = valid.shape
        lens = (_focal_pixels(frame), n_rows, n_cols)
        if lens != self.lens:
            self.lens = lens
            field = rr.Pinhole(
                focal_length=lens[0],
                resolution=(n_cols, n_rows),
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=2.0 * self.size_m,
            )
            stream.log([*lidar, "field"], field)

    def _images(self, stream: Any, frame: Frame) -> None:
        """Write the reading in metres and counts, with a cover where nothing was reported."""
        rr = self.rr
        middle_m = _median_m(frame) if self.scale.relative else 0.0
        middle_m = middle_m if np.isfinite(middle_m) else 0.0
        limits = (max(middle_m + self.scale.low_m, 0.0), max(middle_m + self.scale.high_m, 0.0))
        stream.log(RANGE, rr.DepthImage(frame.range_m, meter=1.0, colormap="Viridis", depth_range=limits))
        stream.log(f"{RANGE}/{_COVER}", rr.SegmentationImage((~frame.valid).astype(np.uint8), opacity=1.0))
        stream.log(INTENSITY, rr.Image(frame.intensity_counts, color_model="L"))

    def _camera_image(self, stream: Any, frame: Frame, name: str) -> None:
        """Write the image of a camera, stretched for a screen, with its exposure and the counts at both ends."""
        rr, image, stretch = self.rr, frame.camera[name], Stretch.of(name, frame)
        stream.log(
            f"{CAMERAS}/{name}",
            rr.Image(stretch.paint(image.intensity_counts), color_model="RGB"),
            rr.AnyValues(
                drop_untyped_nones=False,
                exposure_s=float(image.exposure_s),
                stretch_counts=[stretch.low_counts, stretch.high_counts],
            ),
        )

    def blueprint(self) -> Any:
        """Return the layout of the viewer: space on the left, seen from the lidar's side; images on the right."""
        import rerun.blueprint as layout

        toward = self.first.truth.pose(self.world, "lidar").translation
        toward = toward / max(float(np.linalg.norm(toward)), 1e-12)
        eye = 2.7 * self.size_m * (toward + np.array([0.0, 0.0, 0.45]))
        space = layout.Spatial3DView(
            origin=self.world,
            name="in space",
            background=split_rgb(DARK.paper),
            line_grid=False,
            eye_controls=layout.EyeControls3D(position=eye, look_target=(0.0, 0.0, 0.0), eye_up=(0.0, 0.0, 1.0)),
        )
        words, low, high = self.scale.range_words
        images = layout.Vertical(
            layout.Spatial2DView(origin=RANGE, name=f"{words}: {low} to {high}"),
            layout.Spatial2DView(origin=INTENSITY, name="Intensity [counts]"),
            *[
                layout.Spatial2DView(origin=f"{CAMERAS}/{name}", name=f"Camera {name}, stretched")
                for name in self.cameras
                if name in self.first.camera
            ],
        )
        return layout.Blueprint(
            layout.Horizontal(space, images, column_shares=[2.2, 1.0]),
            layout.TimePanel(timeline=TIME, playback_speed=self.speed),
            collapse_panels=True,
        )


def _median_m(frame: Frame) -> float:
    """Return the median range [m] of the target's returns, NaN where none came back."""
    seen = frame.range_m[find_target_returns(frame)]
    return float(np.median(seen)) if seen.size else float("nan")


def _focal_pixels(frame: Frame) -> float:
    """Return the focal length in pixels, from the lines of sight of the field's first and last columns."""
    n_rows, n_cols = frame.valid.shape
    sight = frame.line_of_sight[n_rows // 2]
    tangent = sight[:, 0] / sight[:, 2]
    across = float(tangent[-1] - tangent[0])
    return (n_cols - 1) / across if across > 0 else float(n_cols)
