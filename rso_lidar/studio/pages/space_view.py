"""The element that shows a scene in space, with three.js as NiceGUI brings it."""

from __future__ import annotations

import nicegui.elements.scene  # registers the module with three.js
from nicegui.element import Element

_ = nicegui.elements.scene


class SpaceView(Element, component="space_view.js"):
    """A view of the scene at an address; it changes when the address does."""

    def __init__(self, label: str, models: str) -> None:
        """Make an empty view; `label` names it to screen readers, and `models` begins the addresses of meshes."""
        super().__init__()
        self._props["label"], self._props["models"], self._props["url"] = label, models, ""

    def show(self, url: str) -> None:
        """Show the scene at an address."""
        self._props["url"] = url
        self.update()
