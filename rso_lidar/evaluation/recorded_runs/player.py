"""A recording in a window: range and intensity side by side, the cloud in space with the true edges of the target.

Only the frame shown is read. Keys: left and right step (page up and down: ten frames; home, end), space plays, c changes
the meaning of the cloud's colour. The slider selects any frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rso_lidar.errors import RecordingError
from rso_lidar.picture import (
    LIGHT,
    Scale,
    Scheme,
    Shape,
    Thumbnail,
    choose_window,
    colour_maps,
    draw_intensity,
    draw_range,
    even_indices,
    figures,
    find_target_returns,
    palette,
    recolour,
    summarize_frame,
)
from rso_lidar.records import Frame

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Colour = Literal["range", "intensity"]
SIZE_IN = (14.0, 5.8)
STILL_IN = (SIZE_IN[0], 5.2)  # without the slider
STEP_MS = 100  # from frame to frame while it plays
FAR = 10  # frames that page up and page down skip
_STEPS = {"left": -1, "right": 1, "pageup": -FAR, "pagedown": FAR}
_OURS = ("keymap.back", "keymap.forward", "keymap.home")  # key bindings of matplotlib that the player replaces
_LOOKED_AT = 12
_MANY = 600  # number of points above which they are drawn small
_HINT = "left, right: frame    space: play    c: colour    drag the cloud to turn it"


class Player:
    """Frames in a figure, one at a time; `shown` is the index of the one shown, `playing` whether it advances by itself."""

    def __init__(
        self,
        frames: Sequence[Frame],
        shapes: Iterable[Shape] = (),
        colour: Colour = "range",
        *,
        figure: Figure | None = None,
        first: int = 0,
        controls: bool = True,
        scheme: Scheme = LIGHT,
    ) -> None:
        """Draw one frame into a figure.

        Parameters
        ----------
        frames : a recording, or some of its frames
        shapes : true meshes whose edges are drawn
        colour : what the colour of the cloud means
        figure : where to draw (None: a new figure on an Agg canvas)
        first : index of the frame shown first
        controls : whether there is a slider, and the help on keys
        scheme : `LIGHT` or `DARK`
        """
        from matplotlib.widgets import Slider

        if not len(frames):
            raise RecordingError("nothing to draw: the recording has no frames")
        self.frames, self.shapes, self.colour = frames, tuple(shapes), colour
        self.figure = figure or _figure(SIZE_IN if controls else STILL_IN)
        self.playing, self.scheme = False, scheme
        self.shown = first
        left, wide = 0.04, 0.235
        low, high, under, over = (0.17, 0.66, 0.13, 0.74) if controls else (0.09, 0.73, 0.05, 0.82)
        self._range = self.figure.add_axes((left, low, wide, high))
        self._intensity = self.figure.add_axes((left + 0.328, low, wide, high))
        space: Any = self.figure.add_axes((0.675, under, 0.31, over), projection="3d", computed_zorder=False)
        space.view_init(elev=14, azim=-72)
        self._space = space
        self._title = self.figure.text(
            0.01, 0.975, "", fontsize=figures.TITLE_PT, weight="bold", color=palette.INK, va="top"
        )
        self._note = self.figure.text(0.01, 0.918, "", fontsize=figures.TEXT_PT, color=palette.QUIET, va="top")
        if controls:
            self.figure.text(0.99, 0.975, _HINT, fontsize=figures.SMALL_PT, color=palette.QUIET, va="top", ha="right")
        self.slider = None
        if controls and len(frames) > 1:
            place = self.figure.add_axes((0.09, 0.03, 0.78, 0.035))
            self.slider = Slider(place, "frame", 0, len(frames) - 1, valinit=first, valstep=1, color=palette.MARK)
            self.slider.drawon = False  # the new frame is drawn anyway
            self.slider.label.set_color(palette.QUIET)
            self.slider.valtext.set_color(palette.QUIET)
            self.slider.on_changed(lambda place: self._show(round(place)))
        self.figure.canvas.mpl_connect("key_press_event", self._on_key)
        self.figure.canvas.mpl_connect("close_event", lambda event: self._play(on=False))
        self._timer = self.figure.canvas.new_timer(interval=STEP_MS)
        self._timer.add_callback(self.tick)
        self._show(first)

    def go(self, place: int) -> None:
        """Show the frame at an index, or the nearest there is."""
        place = min(max(place, 0), len(self.frames) - 1)
        if self.slider is None:
            self._show(place)
        elif place != self.shown:
            self.slider.set_val(place)  # which shows it

    def tick(self) -> None:
        """Advance by a frame while playing, and stop at the last."""
        if not self.playing:
            return
        if self.shown + 1 < len(self.frames):
            self.go(self.shown + 1)
        else:
            self._play(on=False)

    def _on_key(self, event: Any) -> None:
        if event.key in _STEPS:
            self.go(self.shown + _STEPS[event.key])
        elif event.key in ("home", "end"):
            self.go(0 if event.key == "home" else len(self.frames) - 1)
        elif event.key == " ":
            if not self.playing and self.shown == len(self.frames) - 1:
                self.go(0)
            self._play(on=not self.playing)
        elif event.key == "c":
            self.colour = "intensity" if self.colour == "range" else "range"
            self._show(self.shown)

    def _play(self, *, on: bool) -> None:
        self.playing = on
        if on:
            self._timer.start()
        else:
            self._timer.stop()

    def _show(self, place: int) -> None:
        self.shown = place
        frame = self.frames[place]
        window = choose_window(frame)
        for axes, draw in ((self._range, draw_range), (self._intensity, draw_intensity)):
            axes.clear()
            draw(axes, frame, window)
            axes.tick_params(labelsize=figures.SMALL_PT, colors=palette.QUIET)
            for spine in axes.spines.values():
                spine.set_color(palette.QUIET)
        self._draw_space(frame)
        self._title.set_text(frame.source.title)
        self._note.set_text(summarize_frame(frame))
        if self.slider is not None:
            self.slider.valtext.set_text(f"{frame.index}, {place + 1} of {len(self.frames)}")
        recolour(self.figure, self.scheme)
        self.figure.canvas.draw_idle()

    def _draw_space(self, frame: Frame) -> None:
        """Draw the cloud and the true edges in lidar axes, with up at the top."""
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        axes = self._space
        axes.clear()
        points_m, colours = _cloud(frame, self.colour)
        edges_m = [_in_lidar(frame, shape) for shape in self.shapes if shape.axes in frame.truth.poses]
        middle, half_m = _bounds(frame, self.shapes, edges_m)
        near = (np.abs(points_m - middle) <= half_m).all(axis=-1)
        for lines in edges_m:
            axes.add_collection3d(
                Line3DCollection(_plot_axes(lines), colors=[palette.IMAGE_EDGE], linewidths=figures.HAIR_PT, zorder=1)
            )
        x, y, z = _plot_axes(points_m[near]).T
        size = 5.0 if len(x) > _MANY else 14.0
        axes.scatter(x, y, z, c=colours[near] / 255.0, s=size, depthshade=False, lw=0, zorder=2)
        for low, set_limits in zip(_plot_axes(middle), (axes.set_xlim, axes.set_ylim, axes.set_zlim), strict=True):
            set_limits(low - half_m, low + half_m)
        axes.set_box_aspect((1, 1, 1), zoom=1.08)
        for axis, name in ((axes.xaxis, "right"), (axes.yaxis, "ahead"), (axes.zaxis, "up")):
            axis.set_pane_color(palette.NO_RETURN)
            axis._axinfo["grid"].update({"color": palette.IMAGE_GREY, "linewidth": figures.HAIR_PT})
            axis.set_label_text(f"{name} [m]", fontsize=figures.SMALL_PT, color=palette.QUIET)
            axis.set_tick_params(labelsize=figures.SMALL_PT, colors=palette.QUIET)
            axis.set_major_locator(_few_ticks())
            axis.get_major_formatter().set_useOffset(False)
        beyond = int((~near).sum())
        note = f", {beyond:,} return{'s' * (beyond > 1)} elsewhere" if beyond else ""
        truth = "; edges: truth" if edges_m else ""
        axes.set_title(
            f"Cloud, colour: {self.colour}{truth}{note}", fontsize=figures.HEADING_PT, color=palette.INK, y=1.02, pad=0
        )


def find_fullest_frame(frames: Sequence[Frame]) -> int:
    """Find the index of the frame with most returns among a dozen."""
    return max(even_indices(len(frames), _LOOKED_AT), key=lambda k: int(find_target_returns(frames[k]).sum()))


def play(
    frames: Sequence[Frame], shapes: Iterable[Shape] = (), colour: Colour = "range", scheme: Scheme = LIGHT
) -> Player:
    """Show the player in a window, and return it when the window is closed; a notebook does not wait."""
    import matplotlib
    from matplotlib import pyplot

    free: dict[Any, Any] = {name: [] for name in _OURS}
    with matplotlib.rc_context(free):
        player = Player(frames, shapes, colour, figure=pyplot.figure(figsize=SIZE_IN), scheme=scheme)
        pyplot.show()
    return player


def window_backend() -> str | None:
    """Return the name of matplotlib's backend if it opens windows here, None if it draws into files only."""
    from matplotlib import pyplot
    from matplotlib.backends.registry import backend_registry

    try:
        name = str(pyplot.get_backend())
        registry: Any = backend_registry
        canvas = registry.load_backend_module(name).FigureCanvas
    except (ImportError, ValueError, AttributeError):  # the backend asked for is not installed
        return None
    return name if canvas.required_interactive_framework is not None else None


def _figure(size_in: tuple[float, float]) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size_in, dpi=figures.SCREEN_DPI)
    FigureCanvasAgg(figure)
    return figure


def _few_ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4)


def _plot_axes(lidar_m: np.ndarray) -> np.ndarray:
    """Reorder points (…, right_down_ahead) to (…, right_ahead_up), since matplotlib draws the last axis upward."""
    return np.stack([lidar_m[..., 0], lidar_m[..., 2], -lidar_m[..., 1]], axis=-1)


def _in_lidar(frame: Frame, shape: Shape) -> np.ndarray:
    """Return the ends (edge, 2, xyz) [m] of a shape's edges in lidar axes."""
    lidar_from_axes = frame.truth.pose("lidar", shape.axes)
    return np.asarray(lidar_from_axes.apply(shape.edges_m.reshape(-1, 3))).reshape(-1, 2, 3)


def _cloud(frame: Frame, colour: Colour) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (point, xyz) [m] in lidar axes, and their colours (point, rgb)."""
    valid = frame.valid
    if colour == "range":
        return frame.points_m[valid], Scale.of_frames(frame).range_rgb(frame.range_m[valid], 0.0)
    scale = Scale.of([Thumbnail.of(frame)])
    return frame.points_m[valid], colour_maps.apply_ramp(
        scale.intensity_fraction(frame.intensity_counts[valid]), colour_maps.INTENSITY_RAMP, palette.QUIET
    )


def _bounds(frame: Frame, shapes: Sequence[Shape], edges_m: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
    """Return the middle (xyz) and half the side [m] of a cube around the target, or around the returns without one."""
    if edges_m:
        held = np.concatenate([lines.reshape(-1, 3) for lines in edges_m[: _of_one_target(shapes)]])
    else:
        held = frame.points_m[find_target_returns(frame)]
        held = held if len(held) else frame.points_m[frame.valid]
    if not len(held):
        return np.array([0.0, 0.0, 1.0]), 1.0
    low, high = held.min(axis=0), held.max(axis=0)
    return 0.5 * (low + high), max(0.52 * float((high - low).max()), 0.1)


def _of_one_target(shapes: Sequence[Shape]) -> int:
    """Count the shapes, from the first on, that belong to the same target."""
    return next((k for k, shape in enumerate(shapes) if shape.target != shapes[0].target), len(shapes))
