"""The link between the instrument and flight software: delays of readings and commands, and lost readings."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from rso_lidar.part import Fraction, NotNegative, Part

Delay = Annotated[NotNegative, Field(le=3600)]


class DataLink(Part):
    """Delays and losses between the instrument and flight software.

    `serve` applies them. A run does not depend on them. Delay and loss of a reading are drawn from the seed and the number
    of its frame only, so that a late run can be repeated.
    """

    readout_s: Delay = Field(
        default=0.0, description="Time from the flash until the reading has left the instrument [s]. Default: assumed."
    )
    latency_s: Delay = Field(
        default=0.0, description="Time that every reading takes to flight software [s]. Default: assumed."
    )
    jitter_s: Delay = Field(
        default=0.0,
        description="Mean of a further delay, exponentially distributed as in a queue (M/M/1) [s]. Default: assumed.",
    )
    drop_probability: Fraction = Field(
        default=0.0, description="Probability that a reading is lost on its way. Default: assumed."
    )
    command_latency_s: Delay = Field(
        default=0.0,
        description="Time from the time stamp of a command until it acts [s]; that of the PTU's drive is in "
        "`ptu.errors`. Default: assumed.",
    )

    def draw(self, rng: np.random.Generator) -> tuple[float, bool]:
        """Draw the fate of one reading.

        Parameters
        ----------
        rng : generator of this link and this frame

        Returns
        -------
        delay_s
            from the flash until flight software has the reading [s].
        is_lost
            whether it never arrives.
        """
        lost, queued = rng.random(2).tolist()
        return self.readout_s + self.latency_s - self.jitter_s * float(np.log1p(-queued)), lost < self.drop_probability
