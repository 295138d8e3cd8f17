"""A recording looked at: in Rerun where the extra is installed, else in a window of matplotlib, else in files."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

from rso_lidar import picture
from rso_lidar.errors import RecordingError, RsoLidarError, did_you_mean, warn
from rso_lidar.evaluation.recorded_runs.flown_scenario import load_scenario, load_surfaces
from rso_lidar.evaluation.recorded_runs.player import Colour, Player, find_fullest_frame, play, window_backend
from rso_lidar.export import Frames, Recording, list_cameras
from rso_lidar.files import check_writable
from rso_lidar.interruption import make_temporary_folder
from rso_lidar.picture import ANIMATION_SUFFIXES, FIGURE_SUFFIXES, LIGHT, Scheme, Shape, rerun_scene, save_figure
from rso_lidar.records import Frame, Source

_SCENE = ".rrd"
_PICTURES = (*FIGURE_SUFFIXES, *ANIMATION_SUFFIXES)
_SHEET = "_view_sheet.png"
_SHEET_FRAMES = 16
_BESIDE = ("_view.png", _SHEET, "_view.gif")  # ends of the files beside a recording


@dataclass(frozen=True)
class ViewerChoice:
    """The way a recording is shown: one of `TOOLS`, the reason, and the files to write (none: a window opens).

    `contents` describe the frames that each file shows, once it is written. `COLOURS` are those that points may have.
    """

    TOOLS: ClassVar[tuple[str, ...]] = ("rerun", "window", "files")
    COLOURS: ClassVar[tuple[Colour, ...]] = ("range", "intensity")

    tool: str
    why: str
    paths: tuple[Path, ...] = ()
    contents: tuple[str, ...] = ()

    def describe(self) -> str:
        """Describe in a line what was written, with which frames, and why; or what was opened."""
        if not self.paths:
            return self.why
        named = ", ".join(f"{path} ({frames})" for path, frames in zip(self.paths, self.contents, strict=True))
        why = f"{self.why}: wrote" if self.why else "wrote"
        more = f"; open it with: rerun {self.paths[0]}" if self.tool == "rerun" else ""
        return f"{why} {named}{more}"


def choose_viewer(
    tool: str | None = None,
    output: str | Path | None = None,
    *,
    recording: Path | None = None,
    overwrite: bool = False,
) -> ViewerChoice:
    """Choose how to show a recording on this machine, and check that it is possible.

    Parameters
    ----------
    tool : one of `ViewerChoice.TOOLS` (None: the first that is available, or the one that the suffix of `output` implies)
    output : a scene (.rrd), a picture of the window (.png, .pdf, .svg) or an animation (.gif, .mp4)
    recording : file of the recording, beside which files without a name are written (None: none are)
    overwrite : whether existing files are replaced

    Raises
    ------
    RecordingError
        For a tool that is unknown or not available, and for files that exist already.
    """
    if tool is not None and tool not in ViewerChoice.TOOLS:
        known = ViewerChoice.TOOLS
        raise RecordingError(
            f"view: no viewer is named '{tool}'{did_you_mean(tool, known)} (known: {', '.join(known)})"
        )
    if output is not None:
        return _choose_by_suffix(tool, Path(output), overwrite=overwrite)
    if tool == "rerun":
        rerun_scene.import_rerun("view")
    display = has_display()
    if display and (tool == "rerun" or (tool is None and rerun_scene.has_rerun())):
        return ViewerChoice("rerun", "Rerun")
    backend = window_backend() if display and tool != "files" else None
    if backend is not None:
        return ViewerChoice("window", f"matplotlib's window ({backend})")
    why = "matplotlib has nothing to open a window with (pip install PyQt6)" if display else "no display"
    if tool == "window":
        raise RecordingError(f"view: {why}; choose files, or rerun and a name that ends in .rrd")
    return _choose_files_beside(tool or "files", "" if tool == "files" else why, recording, overwrite=overwrite)


def view(
    frames: Sequence[Frame],
    *,
    tool: str | None = None,
    colour: Colour = "range",
    output: str | Path | None = None,
    overwrite: bool = False,
    folder: Path | None = None,
    each: Iterable[Frame] | None = None,
    scheme: Scheme = LIGHT,
    on_window: Callable[[str], None] | None = None,
) -> ViewerChoice:
    """Show a recording in Rerun, in a window of matplotlib or in files; return when its window is closed.

    Parameters
    ----------
    frames : a recording, or a part of one such as ``recording[::10]``
    tool : ``"rerun"``, ``"window"`` or ``"files"`` (None: the first that is available; without a display, files beside the
        recording)
    colour : of the points, ``"range"`` or ``"intensity"``
    output : file to write instead: a scene (.rrd), a picture of the window (.png, .pdf, .svg) or an animation (.gif, .mp4)
    overwrite : whether existing files are replaced

    Other Parameters
    ----------------
    folder : folder of the mesh files that the scenario names (None: that of the recording)
    each : iterator over the same frames that reports progress while a scene for Rerun is written (None: `frames`)
    scheme : of pictures and of matplotlib's window, `LIGHT` or `DARK`
    on_window : called with a line of text before a window opens

    Returns
    -------
    ViewerChoice
        How it was shown, and the files that were written.

    Raises
    ------
    RecordingError
        For a recording without frames, a tool that is not available, and files that exist already.
    """
    path = _find_path(frames)
    chosen = choose_viewer(tool, output, recording=path, overwrite=overwrite)
    if on_window is not None and not chosen.paths:
        on_window(f"{chosen.why}: {_count_frames(len(frames))}; close it to go on")
    folder = folder or (path.parent if path else None)
    return replace(chosen, contents=_show(chosen, frames, colour, folder, each, scheme))


def _show(
    chosen: ViewerChoice,
    frames: Sequence[Frame],
    colour: Colour,
    folder: Path | None,
    each: Iterable[Frame] | None,
    scheme: Scheme,
) -> tuple[str, ...]:
    """Show frames in the chosen way, and describe the frames that each file shows."""
    if colour not in ViewerChoice.COLOURS:
        known = ViewerChoice.COLOURS
        raise RecordingError(f"view: no colour '{colour}'{did_you_mean(colour, known)} (known: {', '.join(known)})")
    if not len(frames):
        raise RecordingError("view: the recording has no frames; record some")
    suffixes = {path.suffix.lower() for path in chosen.paths}
    needless = bool(suffixes) and suffixes <= {*ANIMATION_SUFFIXES}  # animations show no mesh
    shapes = [] if needless else load_true_shapes(frames[0].source, folder)
    described = list_cameras(Path("view"), frames[0].source.scenario) if frames[0].camera else []
    cameras = {camera.name: camera.pinhole.matrix for camera in described}
    if chosen.tool == "window":
        play(frames, shapes, colour, scheme)
        return ()
    if _SCENE in suffixes:
        rerun_scene.write_rerun(frames, chosen.paths[0], shapes, colour=colour, each=each, cameras=cameras)
        return (_count_frames(len(frames)),)
    if chosen.tool == "rerun":
        with make_temporary_folder() as place:
            scene = Path(place, "recording.rrd")
            rerun_scene.write_rerun(frames, scene, shapes, colour=colour, each=each, cameras=cameras)
            rerun_scene.open_rerun(scene)
        return ()
    return tuple(_write_pictures(chosen.paths, frames, shapes, colour, scheme))


def _count_frames(count: int) -> str:
    return f"{count} frame{'s' * (count != 1)}"


def _write_pictures(
    paths: Sequence[Path], frames: Sequence[Frame], shapes: Sequence[Shape], colour: Colour, scheme: Scheme
) -> list[str]:
    """Write pictures by the suffix of their names, and describe the frames that each shows."""
    count, contents = len(frames), []
    for path in paths:
        if path.suffix.lower() in ANIMATION_SUFFIXES:
            picture.animate(frames, path, scheme=scheme)
            contents.append(_count_frames(count))
        elif len(paths) > 1 and path.name.endswith(_SHEET):
            picture.contact_sheet(frames, path, scheme=scheme)
            contents.append(f"{_SHEET_FRAMES} of {count} frames" if count > _SHEET_FRAMES else _count_frames(count))
        else:
            best = frames[find_fullest_frame(frames)]
            save_figure(Player([best], shapes, colour, controls=False, scheme=scheme).figure, path)
            contents.append(f"frame {best.index}" + f" alone, of {count}, for its many returns" * (count > 1))
    return contents


def load_true_shapes(source: Source, folder: Path | None = None) -> list[Shape]:
    """Load the recorded meshes, each with the name of its axes; none, with a warning, where one is missing."""
    shapes: list[Shape] = []
    try:
        scenario = load_scenario(source, folder)
        for number in range(len(source.targets)):
            surfaces = load_surfaces(scenario, source, number, "view")
            shapes += [Shape(surface.name, surface.corners) for surface in surfaces]
    except (RsoLidarError, OSError) as error:
        warn(f"view: drawn without true meshes: {error}")
        return []
    return shapes


def has_display() -> bool:
    """Return whether there is a screen: always on macOS and Windows, else if DISPLAY or WAYLAND_DISPLAY is set."""
    return sys.platform in ("darwin", "win32") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _choose_by_suffix(tool: str | None, output: Path, *, overwrite: bool) -> ViewerChoice:
    """Choose the way that writes one file, by its suffix, or raise `RecordingError`."""
    known = {"rerun": (_SCENE,), "files": _PICTURES}.get(tool or "", (_SCENE, *_PICTURES))
    if tool == "window":
        raise RecordingError(f"{output}: a window writes no file; omit the name, or choose rerun or files")
    place = check_writable(output, known, overwrite=overwrite)
    if place.suffix.lower() == _SCENE:
        rerun_scene.import_rerun(str(place))
        return ViewerChoice("rerun", "", (place,))
    return ViewerChoice("files", "", (place,))


def _choose_files_beside(tool: str, why: str, recording: Path | None, *, overwrite: bool) -> ViewerChoice:
    """Choose files beside a recording, or raise `RecordingError`."""
    if recording is None:
        raise RecordingError(f"view: {why or 'files'}: these frames have no file to write beside; give output")
    names = (_SCENE,) if tool == "rerun" else _BESIDE
    paths = [recording.with_name(recording.stem + name) for name in names]
    for path in paths:
        try:
            check_writable(path, (path.suffix,), overwrite=overwrite)
        except RecordingError as error:
            raise RecordingError(f"{why + ', so it would write files: ' if why else ''}{error}") from None
    return ViewerChoice(tool, why, tuple(paths))


def _find_path(frames: Sequence[Frame]) -> Path | None:
    """Return the file that frames are read from; None for frames in memory."""
    recording = frames.recording if isinstance(frames, Frames) else frames
    return recording.path if isinstance(recording, Recording) else None
