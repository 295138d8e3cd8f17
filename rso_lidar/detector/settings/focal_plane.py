"""Optional parts of a focal plane: what makes one pixel differ from the next, and one flash from an ideal one."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rso_lidar.part import Flag, Fraction, NotNegative, Number, Part, Positive, Text

# 128 x 128 APDs of 40 µm: 0.24 pF of 80 µm by the areas. The slope is M/a with M = 20 and a = 45 V (C30645). R is assumed.
_SMALL_JUNCTIONS = {"capacitance_nf": 1.0, "resistance_ohm": 1000.0, "gain_slope_per_v": 0.44}
_SLOPES = {"large_junctions": (0.22, 10.0), "small_junctions": (0.44, 20.0)}  # slope [1/V] and the gain it belongs to


class Timing(Part):
    """Timing jitter, 1 sigma: `pixel_jitter_ns` of each pixel and flash, and `frame_jitter_ns` of a whole flash.

    The default of the first is 0.334 ns or 5 cm. It is the plateau of the range noise at high signal in Fuller et al.,
    sec. 3.3, which a matched filter alone would undercut. Its cause is assumed.
    """

    pixel_jitter_ns: NotNegative = Field(
        default=0.334,
        description=(
            "Timing jitter of each pixel and flash, 1 sigma [ns]; 0.334 ns is 5 cm of range. Default: Fuller et al., "
            "sec. 3.3 (5 cm, 1 sigma, at sufficient signal); that the cause is jitter of each pixel is assumed."
        ),
    )
    frame_jitter_ns: NotNegative = Field(
        default=0.0, description="Timing jitter common to all pixels of a flash, 1 sigma [ns]. Default: a choice."
    )


class Maps(Part):
    """Fixed patterns of a camera: spread over its pixels of gain, offset and t0, 1 sigma.

    Uncalibrated cameras have 5-15 %, a few counts and 0.3-1 ns. With `calibrated` the reading is corrected by maps measured
    beforehand. The correction leaves `residual_fraction` of each pixel's deviation. All figures are assumed.

    `file` names the measured maps of one camera, as `rso-lidar camera fit` writes them (docs/camera_fit.md). They take the
    place of drawn ones, and their dead and hot pixels that of `Defects`. Thresholds are drawn where the file has none.
    """

    file: Text | None = Field(
        default=None,
        description=(
            "Path of the measured maps of one camera (.npz), for an array of as many rows and columns. Pixels are nominal "
            "in what it does not hold, and the spreads below are for closed forms alone. If omitted, all maps are drawn."
        ),
    )

    gain_spread_fraction: Annotated[Number, Field(ge=0.0, le=0.3)] = Field(
        default=0.10, description="Spread of the gain from pixel to pixel, 1 sigma over the mean; assumed."
    )
    offset_spread_counts: NotNegative = Field(
        default=3.0, description="Spread of the baseline from pixel to pixel, 1 sigma [counts]; assumed."
    )
    t0_spread_ns: NotNegative = Field(
        default=0.6, description="Spread of the time origin from pixel to pixel, 1 sigma [ns]; assumed."
    )
    calibrated: Flag = Field(default=False, description="Whether readings are corrected by maps measured beforehand.")
    residual_fraction: Fraction = Field(
        default=0.1, description="Share of each deviation that remains after calibration; assumed."
    )

    @property
    def unknown_fraction(self) -> float:
        """Share of each deviation that remains after calibration."""
        return self.residual_fraction if self.calibrated else 1.0


class Defects(Part):
    """Pixels that never fire (`dead_fraction`) and pixels with a dark current of `hot_dark_current_na`; assumed."""

    dead_fraction: Fraction = Field(default=0.002, description="Share of pixels that never trigger; assumed.")
    hot_fraction: Fraction = Field(default=0.002, description="Share of pixels with a high dark current; assumed.")
    hot_dark_current_na: NotNegative = Field(default=100.0, description="Dark current of a hot pixel [nA]; assumed.")

    @model_validator(mode="after")
    def _no_more_than_all(self) -> Self:
        if self.dead_fraction + self.hot_fraction > 1.0:
            raise ValueError("dead_fraction + hot_fraction is over 1; reduce one of them")
        return self


class Saturation(Part):
    """An amplifier that clips at `rail_electrons` and recovers with the time constant `recovery_ns`.

    A pulse that reaches the rail is stretched by recovery · ln(overdrive): late centroids, long trailing edges. Assumed.
    """

    rail_electrons: Positive = Field(
        default=600_000.0, description="Highest amplitude that the amplifier can pass [electrons]; assumed."
    )
    recovery_ns: Positive = Field(
        default=4.0, description="Time constant of the recovery from saturation [ns]; assumed."
    )


class Droop(Part):
    """An APD bias that sags under the photocurrent of the whole array, and with it the gain of every pixel.

    C dV/dt = (V₀ − V)/R − Σ i(t): the sum of the photocurrents loads the bias regulator (M. Seal, Nonlinear time-variant
    response in an avalanche photodiode array based LADAR, thesis, AFIT; it gives no legible circuit values).

    A sag of v leaves 1/(1 + `gain_slope_per_v` · v) of the gain, which is M = a/(V_b − V). The data sheet of the InGaAs APDs
    C30645 and C30662 (Excelitas) states this law above M = 4. With a = 40 to 50 V the slope is 0.22 per volt at M = 10.
    Miller's law M = 1/(1 − (V/V_b)ⁿ) has the same form near V_b.

    C is that of the junctions. From 80 to 200 µm it rises by 1.25 pF (same data sheet). A pixel of 80 µm therefore has
    0.24 pF, and 128 x 128 pixels have 4 nF. Two things are assumed: that nothing else holds the bias, and R, the output
    resistance of the regulator (a loop of 0.8 MHz with C).

    `preset` chooses the array. ``large_junctions`` is the above. ``small_junctions`` loses 16 times as much gain to the same
    light: APDs of 40 µm (0.06 pF by their area, 1 nF in all) at a gain of 20, behind a series resistor of 1 kΩ. Set
    `apd.gain` to 20 with it. Its range errors are two to six times the bound of shot noise where 8,000 to 22,000 photons
    light every pixel. Diameter, gain and resistor are assumed, because no source gives those of a camera. A key that is
    given keeps its value.
    """

    preset: Literal["large_junctions", "small_junctions"] = Field(
        default="large_junctions",
        description=(
            "Array whose constants fill the keys that are not given: APDs of 80 µm at a gain of 10, or APDs of 40 µm at "
            "a gain of 20 behind a series resistor of 1 kΩ. Default: a choice."
        ),
    )
    capacitance_nf: Positive = Field(
        default=4.0,
        description=(
            "Capacitance C that holds the APD bias [nF]: the junctions of 128 x 128 pixels, from a data sheet. No "
            "further capacitance is assumed. `small_junctions` has 1."
        ),
    )
    resistance_ohm: Positive = Field(
        default=50.0,
        description="Output resistance R of the bias regulator [Ω]; assumed. `small_junctions` has 1000.",
    )
    gain_slope_per_v: NotNegative = Field(
        default=0.22,
        description=(
            "Slope of the gain loss [1/V]: a sag of v volts leaves 1/(1 + slope · v) of the gain. From the data sheet "
            "of InGaAs APDs at a gain of 10. `small_junctions` has 0.44, for a gain of 20."
        ),
    )

    @model_validator(mode="after")
    def _fill_from_preset(self) -> Self:
        if self.preset == "small_junctions":
            given = self.model_fields_set
            self.__dict__.update({key: value for key, value in _SMALL_JUNCTIONS.items() if key not in given})
        return self

    @property
    def slope_gain(self) -> float | None:
        """Gain of the APD to which the slope belongs; None for a slope that is not the preset's."""
        slope, gain = _SLOPES[self.preset]
        return gain if self.gain_slope_per_v == slope else None


class Bloom(Part):
    """Charge above the full well of a pixel, of which its four neighbours collect a share; assumed.

    Of the charge that one pulse makes beyond `full_well_electrons`, `spill_fraction` leaves the pixel, a quarter to each
    side, and spills on where it overflows again. The law is that of blooming in imagers without a drain, assumed for an APD
    whose junction is discharged by its own photocurrent. A junction of 0.24 pF (`Droop`) that loses 1 V has passed 1.5
    million electrons, which is the default of the full well.
    """

    full_well_electrons: Positive = Field(
        default=1.5e6,
        description=(
            "Charge after the APD that a pixel can hold of one pulse [electrons]. Default: assumed, 1 V across the junction "
            "of 0.24 pF that a data sheet gives."
        ),
    )
    spill_fraction: Annotated[Fraction, Field(lt=1)] = Field(
        default=0.2,
        description="Share of the charge above the full well that the neighbours collect. Default: assumed.",
    )
    delay_ns: NotNegative = Field(
        default=0.0, description="How much later the neighbours collect it [ns]. Default: assumed."
    )


class Crosstalk(Part):
    """Electronic crosstalk between pixels that latch together (simultaneous ranging crosstalk, Opt. Eng. 60(8) 083101).

    Where a share s of the array latches within one clock of a pixel, its range scatters by `noise_m` · s, 1 sigma. The
    mean shift is common to the array, and calibration removes it at one share, `calibrated_fraction` (0.5 for a
    checkerboard, 1 for a wall). The rest is `offset_m` · (s − `calibrated_fraction`).

    The paper states a precision of 8.04 cm for a camera of 128 x 128 pixels before a checkerboard, which triggers half of
    them. `noise_m` makes the default camera give that: 5 cm come from `timing`, the rest is taken for crosstalk. Its growth
    with s is not published; linear growth is assumed. No mean shift is published either: 0 describes a calibrated camera.
    """

    offset_m: Number = Field(
        default=0.0,
        description=(
            "Mean range shift, before calibration, when the whole array triggers within one clock [m]. 0 describes a "
            "calibrated camera."
        ),
    )
    calibrated_fraction: Fraction = Field(
        default=0.0,
        description=(
            "Share of the array that triggered together when the mean shift was calibrated: 0.5 for a checkerboard."
        ),
    )
    noise_m: NotNegative = Field(
        default=0.126,
        description=(
            "Range noise when the whole array triggers within one clock, 1 sigma [m]. Derived from a published "
            "precision of 8.04 cm (Opt. Eng. 60(8) 083101)."
        ),
    )


_FARTHEST = 16  # pixels: a kernel of 33 x 33 for each pixel
# Level at the distances 1, 2, 3 and 4: the published ends, and a straight line in dB between them.
_PUBLISHED_DB = {"pixell": (-40.0, -40.0 - 20.0 / 3.0, -40.0 - 40.0 / 3.0, -60.0)}


class AmplitudeCrosstalk(Part):
    """Electronic crosstalk between neighbours in amplitude: each pixel also shows a share of what its neighbours amplify.

    y = x + Σ 10^(L/20) x of the neighbours, x the output of each pixel's own amplifier, with its noise and its rail. L is
    the level at the neighbour's distance in pixels. Between whole distances, as on a diagonal, L follows a straight line.
    Beyond the last distance nothing couples. The comparator and the converter see y, which the rail limits too. A timing
    channel (`zero_crossing`) sees x alone.

    The preset ``pixell`` is the Leddar Pixell (LeddarTech, user guide 54A0049 7.0, sec. 2.2): about 40 dB below the
    amplitude of the bright pixel just next to it, decreasing gradually to about 60 dB from 4 pixels on. "Gradually" is
    taken as linear in dB, and 4 as the last distance. The guide states over 16 dB less after its correction. Assumed: that
    the crosstalk has the shape and the sign of the pulse and no delay, and that it spreads along rows and columns alike.
    """

    preset: Literal["pixell"] = Field(
        default="pixell",
        description=(
            "Published levels: pixell has -40 dB at the next pixel and -60 dB at the fourth. Default: Leddar Pixell user "
            "guide 54A0049 7.0, sec. 2.2; levels between are assumed."
        ),
    )
    levels_db: tuple[Annotated[Number, Field(ge=-200.0, lt=0.0)], ...] | None = Field(
        default=None,
        description=(
            "Amplitude over that of the bright pixel, at distances of 1, 2, 3 and more pixels [dB], in place of the "
            "preset's. If omitted, those of the preset."
        ),
    )
    along: Literal["both", "rows", "columns"] = Field(
        default="both",
        description="Which neighbours couple: those of the same row (rows), column (columns), or all. Default: assumed.",
    )

    @model_validator(mode="after")
    def _one_choice(self) -> Self:
        if self.levels_db is not None and "preset" in self.model_fields_set:
            raise ValueError("preset and levels_db determine the same; leave one out")
        if not 1 <= len(self.level_db) <= _FARTHEST:
            raise ValueError(f"levels_db has {len(self.level_db)} levels; give 1 to {_FARTHEST}")
        return self

    @property
    def level_db(self) -> tuple[float, ...]:
        """Level at distances of 1, 2, 3 and more pixels [dB]."""
        return self.levels_db if self.levels_db is not None else _PUBLISHED_DB[self.preset]


class Speckle(Part):
    """Interference of coherent light: the photons of a return follow a gamma law of M = 1 + A Ω / λ² modes.

    A is the aperture, Ω the lit solid angle in the pixel. A depolarising surface has twice the number of modes.
    """

    depolarising: Flag = Field(
        default=True,
        description="Whether the surface depolarises the light, which doubles the number of speckle modes.",
    )
