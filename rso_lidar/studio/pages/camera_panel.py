"""The panel of the page See with the image of a camera, beside the lidar's range."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import events, ui

from rso_lidar.picture import Scheme, choose_camera_window, choose_window
from rso_lidar.records import Frame
from rso_lidar.studio.model.companion_image import describe_point, draw_camera_image
from rso_lidar.studio.model.frame_image import IMAGE_SIZE
from rso_lidar.studio.pages.elements import mark

_HINT = "Point at a pixel: its counts, target and part stand here."


class CameraPanel:
    """Choices of camera, band and part of the field; the image; and the pixel that is pointed at."""

    def __init__(self, change: Callable[..., Any], camera: str = "") -> None:
        """Draw the panel.

        Parameters
        ----------
        change : called where another image is asked for
        camera : that is shown first, if the scenario has it
        """
        self._frame: Frame | None = None
        self._first = camera
        self._bands: dict[str, tuple[str, ...]] = {}
        with ui.row(wrap=False).classes("items-center gap-3"):
            self._camera = ui.select([], label="Camera", on_change=self._offer_bands).classes("min-w-[110px]")
            mark(self._camera, "camera", "dense").on_value_change(change)
            self._band = ui.select({"": ""}, value="", label="Band", on_change=change).classes("min-w-[110px]")
            mark(self._band, "band", "dense")
            self._whole = ui.switch("Whole field", on_change=change).props("dense").classes("text-xs")
        self.image = ui.interactive_image(
            size=IMAGE_SIZE, on_mouse=self._point, events=["mousemove", "click"], sanitize=False
        )
        mark(self.image.classes("w-full cursor-crosshair"), "camera-image", "role=img")
        self._words = mark(ui.label(_HINT).classes("text-sm tabular-nums"), "camera-pixel")

    @property
    def camera(self) -> str:
        """Name of the chosen camera; empty for none."""
        return self._camera.value or ""

    def offer(self, cameras: dict[str, tuple[str, ...]]) -> None:
        """Offer the cameras of a flight, with the names of their bands."""
        self._bands = cameras
        kept = next((name for name in (self.camera, self._first) if name in cameras), next(iter(cameras), None))
        self._camera.set_options(list(cameras), value=kept)
        self._offer_bands()

    def _offer_bands(self) -> None:
        bands = self._bands.get(self.camera, ())
        colours = {"": "colour"} if len(bands) == 3 else {}
        options = colours | {name: name for name in bands} or {"": ""}
        if options != self._band.options:
            value = self._band.value if self._band.value in options else next(iter(options))
            self._band.set_options(options, value=value)

    def draw(self, frame: Frame, camera: str, scheme: Scheme) -> bytes:
        """Draw the image of a camera as PNG, in the chosen band if it is the chosen camera."""
        band, whole = str(self._band.value or "") if camera == self.camera else "", bool(self._whole.value)
        return draw_camera_image(frame, camera, scheme, band=band, whole=whole)

    def show(self, frame: Frame, address: str) -> None:
        """Show an image that was drawn, at its address."""
        self._frame = frame
        self._words.text = _HINT
        self.image.props["aria-label"] = f"Image of {self.camera}, and range of the lidar"
        self.image.set_source(address)

    def _point(self, event: events.MouseEventArguments) -> None:
        frame, camera, whole = self._frame, self.camera, bool(self._whole.value)
        if frame is None or camera not in frame.camera:
            return
        windows = choose_window(frame, whole=whole), choose_camera_window(camera, frame, whole=whole)
        text = describe_point(frame, camera, event.image_x, event.image_y, *windows) or _HINT
        if text != self._words.text:
            self._words.text = text
