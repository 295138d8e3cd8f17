"""Settings of a zero-crossing discriminator: a timing channel that makes a unipolar pulse bipolar."""

from typing import Annotated

from pydantic import Field

from rso_lidar import units
from rso_lidar.detector.settings.presets import DEFAULT
from rso_lidar.part import NotNegative, Number, Part, Positive


class ZeroCrossing(Part):
    """A timing channel beside the sampled one: the time of a pulse is the zero crossing of its bipolar shape.

    The photocurrent is differentiated **before** the channel's amplifier, H(f) = 2πi f τ / (1 + 2πi f τ) with τ =
    `differentiator_ns`. Two poles of the detector's amplifier follow, with noise of their own. The crossing of a linear
    pulse does not depend on its amplitude. Strong pulses clip at `rail_electrons`, after the pulse has become bipolar, so
    that the crossing is kept. Baharmast & Kostamovaara (Opt. Eng. 59(10) 104102, 2020) report ±3.5 cm over 1 : 250,000,
    with a resonant circuit in place of the differentiator.

    A clipping stage stores charge and comes off its rail late. The stored charge q follows dq/dt = (x − rail) − q/τᵣ with
    the input x and τᵣ = `recovery_ns`. The output stays on the rail until q is zero. The falling half of the bipolar
    pulse discharges it, so the delay has a limit, about τᵣ, however strong the pulse is.

    The pixel's own trigger decides whether there is a return. From `hold_ns` before its latch on, the channel arms where the
    bipolar pulse is above `arming_electrons`, and fires at the zero crossing that follows (a delay line makes that causal).
    A pixel whose channel never arms, such as one that noise triggers, reports the range of its samples.
    """

    differentiator_ns: Annotated[Number, Field(ge=0.2, le=50.0)] = Field(
        default=4.0,
        description="Time constant τ of the differentiator [ns]. Default: assumed, half the length of the default pulse.",
    )
    noise_electrons: NotNegative = Field(
        default=DEFAULT["noise_electrons"],
        description=(
            "Rms noise of this channel's amplifier at its output, referred to electrons after the APD [electrons]. "
            "Default: assumed, that of the sampled channel."
        ),
    )
    arming_electrons: Positive = Field(
        default=5000.0,
        description=(
            "Height of the bipolar pulse that arms the channel [electrons]. Default: assumed, 5 times the noise, so that "
            "noise seldom arms it."
        ),
    )
    rail_electrons: Positive = Field(
        default=200_000.0,
        description="Amplitude at which this channel's amplifier clips [electrons]. Default: assumed.",
    )
    recovery_ns: Annotated[Number, Field(ge=0.0, le=20.0)] = Field(
        default=0.4,
        description=(
            "Time constant τᵣ of the charge that clipping stores [ns]; crossings of strong pulses come later by up to "
            "about this. Default: assumed, for a walk of the size that Baharmast & Kostamovaara report."
        ),
    )
    hold_ns: Annotated[Number, Field(ge=0.0, le=100.0)] = Field(
        default=5.0,
        description=(
            "Time before the pixel's latch from which on the channel can arm [ns]: weak pulses latch near their peak. "
            "Default: assumed."
        ),
    )

    @property
    def differentiator_s(self) -> float:
        """Time constant of the differentiator [s]."""
        return self.differentiator_ns * units.NS
