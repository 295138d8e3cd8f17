"""Range gate: every pixel stores the same window, and a filter finds pulses in it (Fuller et al., sec. 3.3 and 6)."""

from typing import Annotated

from pydantic import Field

from rso_lidar import units
from rso_lidar.part import Count, NotNegative, Number, Part, Positive


class Gate(Part):
    """A window of `width_ns` that opens `delay_ns` after emission (two-way: 6.67 ns per metre); nothing triggers.

    The samples of `pulses` flashes are averaged. A matched filter then looks for returns above a threshold of constant
    false-alarm rate, `false_alarm_probability` for each pixel and frame. The threshold of a pixel follows from its dark
    current, the sunlight on it and the avalanches of both. Speckle is drawn independently for each pulse,
    as if the target turned a little between them. `lidar.laser.pulse_rate_hz` says how far the scene really moves.
    """

    delay_ns: NotNegative = Field(
        description="Time from emission to the opening of the gate, two-way [ns]: 6.671 ns per metre."
    )
    width_ns: Positive = Field(default=47.6, description="Time for which the gate is open [ns].")
    pulses: Annotated[Count, Field(le=10_000)] = Field(
        default=1, description="Number of flashes whose samples are averaged for one frame."
    )
    false_alarm_probability: Annotated[Number, Field(ge=1e-9, lt=0.5)] = Field(
        default=1e-3, description="False alarm probability of one pixel in one frame; it sets the threshold."
    )

    @property
    def from_m(self) -> float:
        """Range [m] at which the gate opens."""
        return self.delay_ns * units.NS * units.RANGE_PER_DELAY_M_S

    @property
    def to_m(self) -> float:
        """Range [m] at which the gate closes."""
        return (self.delay_ns + self.width_ns) * units.NS * units.RANGE_PER_DELAY_M_S

    def n_samples(self, sample_s: float) -> int:
        """Return the number of samples in the gate, which closes on the last of them.

        Parameters
        ----------
        sample_s : interval between samples [s]
        """
        return max(4, round(self.width_ns * units.NS / sample_s))
