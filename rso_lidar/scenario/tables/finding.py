"""When a target counts as found: pixels of a flash, and flashes of several."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from rso_lidar.part import Count, Part


class Finding(Part):
    """When a target counts as found: at least `pixels` pixels report it, in at least `needed` of `flashes` flashes.

    A pixel reports a target if it receives light from it and its range is the target's. A false alarm is no report, and
    hides the target in its pixel. `check`, `timeline`, `budget` and `trade` use this definition. A run does not depend on
    it.
    """

    pixels: Annotated[Count, Field(le=100_000)] = Field(
        default=1, description="Least number of pixels of one flash that report the target. Default: assumed."
    )
    needed: Annotated[Count, Field(le=1000)] = Field(
        default=1, description="Least number of flashes in which they do, k of n. Default: assumed."
    )
    flashes: Annotated[Count, Field(le=1000)] = Field(
        default=1, description="Number of successive flashes n. Default: assumed, a single flash."
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.needed > self.flashes:
            raise ValueError(f"needed ({self.needed}) is more than flashes ({self.flashes}); give at most as many")
        return self

    def describe(self) -> str:
        """Describe the condition in a few words."""
        pixels = f"{self.pixels} pixel{'s' * (self.pixels > 1)} or more"
        return pixels if self.flashes == 1 else f"{pixels}, in {self.needed} of {self.flashes} flashes or more"
