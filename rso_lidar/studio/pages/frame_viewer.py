"""The viewer of recordings: one slider over the frames of one or two, followed while they are written."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

from nicegui import run, ui

from rso_lidar.errors import RsoLidarError
from rso_lidar.export.reader.recording import Recording
from rso_lidar.picture.frames.frame_image import IMAGE_SIZE, choose_window, draw_difference, draw_image, mark_pixel
from rso_lidar.picture.style.palette import DARK, IMAGE_MARK, LIGHT, OKABE_ITO, Scheme
from rso_lidar.studio.jobs.recording_list import open_recording
from rso_lidar.studio.root_folder import Folder
from rso_lidar.study.recorded_runs.frame_comparison import compare_frames, find_frame, locate_centers

_PLAY_S = 0.15


@dataclass(frozen=True)
class DrawnFrame:
    """What is shown of a frame: images as PNG by title, marks as SVG over the first, and lines of text."""

    images: dict[str, bytes]
    marks: str
    lines: tuple[str, ...]


class FrameViewer:
    """Range and intensity of the frames of a recording, complete or being written, and of another compared with it."""

    def __init__(self, folder: Folder) -> None:
        self._folder = folder
        self._recording: Recording | None = None
        self._other: Recording | None = None
        self.name, self.is_following = "", False
        self._scheme, self._wanted = LIGHT, -1
        self._shown: Any = None
        self._is_drawing = False
        self._title = ui.label("Choose a recording in the list").classes("text-base font-medium")
        with ui.row(wrap=False).classes("w-full items-center gap-2 max-w-[1000px]"):
            self._play = ui.switch("Play").props("dense")
            self._newest = ui.switch("Newest", on_change=lambda event: self._set(len(self)) if event.value else None)
            self._slider = ui.slider(min=0, max=0, step=1, value=0, on_change=lambda event: self._request(event.value))
            self._slider.props('aria-label="Frame" data-test="slider"').classes("grow mx-3").mark("slider")
        with ui.row(wrap=False).classes("w-full items-center gap-3 max-w-[1000px]"):
            self._against = ui.select({None: "nothing"}, value=None, label="Compare with", on_change=self._compare)
            self._against.props('dense outlined data-test="compare"').classes("w-64").mark("compare")
            self._marks = ui.switch("Truth and centroid", on_change=lambda: self._request(self._slider.value))
            self._marks.props('dense data-test="marks"').mark("marks")
        self._words = ui.column().classes("text-sm gap-0").mark("words").props('data-test="words"')
        self._images: dict[str, Any] = {}
        with ui.column().classes("w-full max-w-[1000px] gap-2") as self._stack:
            for title in ("A", "B", "B − A"):
                self._images[title] = ui.interactive_image(size=IMAGE_SIZE, sanitize=False).classes("w-full")
                self._images[title].props(
                    f'role=img data-test="frame-{title[0] if title != "B − A" else "difference"}"'
                )
                self._images[title].set_visibility(False)
        ui.on("studio_dark", lambda event: self._set_scheme(DARK if event.args else LIGHT))
        ui.timer(_PLAY_S, self._advance)

    def __len__(self) -> int:
        return len(self._recording) if self._recording is not None else 0

    async def open(self, name: str) -> None:
        """Show a recording of the folder."""
        self.name, self._shown = name, None
        await self._read()
        await self._request(min(int(self._slider.value), max(len(self) - 1, 0)))

    def offer(self, names: list[str]) -> None:
        """Offer recordings to compare with."""
        options: dict[str | None, str] = {None: "nothing", **{name: name for name in names if name != self.name}}
        if options != self._against.options:
            self._against.set_options(options, value=self._against.value if self._against.value in options else None)

    async def refresh(self) -> None:
        """Read new frames of a recording that is being written."""
        if self.name and self.is_following:
            await self._read()
            if self._newest.value:
                self._set(len(self))
            elif self._shown is None:
                await self._request(self._slider.value)

    def _open_file(self, name: str) -> tuple[Recording, bool] | str:
        try:
            return open_recording(self._folder, name)
        except (RsoLidarError, OSError) as error:
            return str(error)

    async def _read(self) -> None:
        """Open the file that holds the frames now; a file that grows is opened again."""
        name = self.name
        found = await run.io_bound(self._open_file, name)
        if found is None or name != self.name:
            return
        if isinstance(found, str):
            self._tell((found,))
            return
        before, (self._recording, self.is_following) = self._recording, found
        if before is not None and not self._is_drawing:
            before.close()
        self._title.set_text(f"{name}: {self._recording.source.title}, {len(self):,} frames")
        self._slider.props(f"max={max(len(self) - 1, 0)}")

    async def _compare(self, event: Any) -> None:
        """Open the recording to compare with."""
        self._other = None
        if event.value:
            found = await run.io_bound(self._open_file, event.value)
            if isinstance(found, str):
                self._tell((found,))
            elif found:
                self._other = found[0]
        await self._request(self._slider.value)

    def _set_scheme(self, scheme: Scheme) -> Any:
        self._scheme = scheme
        return self._request(self._slider.value)

    def _set(self, count: int) -> None:
        self._slider.set_value(max(count - 1, 0))

    def _advance(self) -> None:
        if self._play.value and len(self) and not self._is_drawing:
            self._slider.set_value((int(self._slider.value) + 1) % len(self))

    def _tell(self, lines: tuple[str, ...]) -> None:
        self._words.clear()
        with self._words:
            for line in lines:
                ui.label(line)

    async def _request(self, k: float) -> None:
        """Draw a frame; while one is drawn, only the last request is kept."""
        self._wanted = int(k)
        if self._is_drawing:
            return
        self._is_drawing = True
        try:
            while self._recording is not None and self._wanted < len(self):
                asked = (self._wanted, self._recording, self._other, bool(self._marks.value), self._scheme)
                if asked == self._shown:
                    return
                drawn = await run.io_bound(_draw, *asked)
                if drawn is None:
                    return
                self._shown = asked
                self._show(drawn)
        finally:
            self._is_drawing = False

    def _show(self, drawn: DrawnFrame) -> None:
        self._tell(drawn.lines)
        for title, image in self._images.items():
            png = drawn.images.get(title)
            image.set_visibility(png is not None)
            if png is not None:
                image.content = drawn.marks if title == "A" else ""
                image.props["aria-label"] = f"Range and intensity, {title}: {drawn.lines[0]}"
                image.set_source(f"data:image/png;base64,{base64.b64encode(png).decode()}")


def _draw(k: int, recording: Recording, other: Recording | None, marked: bool, scheme: Scheme) -> DrawnFrame:
    """Read a frame and draw it, with the frame of the other recording that has its number.

    Parameters
    ----------
    k, recording : the frame.
    other : a recording to compare with, or None.
    marked : whether to mark the targets' origins and the centroid of the points.
    scheme : `LIGHT` or `DARK`.
    """
    try:
        frame = recording[k]
        lines = [f"Frame {frame.index}, {frame.time_s:,.3f} s, {int(frame.valid.sum()):,} returns."]
        images, marks = {"A": draw_image(frame, scheme)}, ""
        second = find_frame(other, frame.index) if other is not None else None
        if second is not None:
            images |= {"B": draw_image(second, scheme), "B − A": draw_difference(frame, second, scheme)}
            lines += compare_frames(frame, second).describe().splitlines()
        elif other is not None:
            lines.append(f"{other.path.name} has no frame {frame.index}.")
        if marked:
            for number, (name, (row, col)) in enumerate(locate_centers(frame).items()):
                colour, dash = ((IMAGE_MARK, ""), (OKABE_ITO[4], "6 4"))[name.startswith("centroid")]
                lines.append(f"{name.capitalize()}: row {row}, column {col} ({'dashed, blue' if dash else 'orange'}).")
                for x, y, side in mark_pixel(choose_window(frame), row, col):
                    x, y, r = x + side / 2, y + side / 2, 12 + 4 * number
                    marks += (
                        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r}" fill="none" stroke="{colour}" stroke-width="3" '
                        f'stroke-dasharray="{dash}"/>'
                    )
        return DrawnFrame(images, marks, tuple(lines))
    except (RsoLidarError, OSError) as error:
        return DrawnFrame({}, "", (str(error),))
