"""
Step 4: own detector
====================

You describe a lidar by its own numbers, find out how far it sees, check that against simulated flashes, and then replace the
detector by a Python object of your own.
"""

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import rso_lidar as rl

work = Path(tempfile.mkdtemp(prefix="tutorial-"))


def shell(command):
    """Run a command of the package in the folder, and print what it prints."""
    words = [sys.executable, "-m", "rso_lidar", *command.split()[1:]]
    done = subprocess.run(words, cwd=work, capture_output=True, text=True, check=True)
    print(f"$ {command}", done.stdout.rstrip(), sep="\n")


# %%
# The numbers of a lidar
# ----------------------
#
# Take the data sheet of your instrument. The laser has an energy, a pulse length and a divergence; the receiver has a
# field and an aperture; the detector has an efficiency, a gain, a noise and a threshold. What you leave out takes a
# default, whose source is on the page of the instrument. This small lidar has 20 mJ and an aperture of 50 mm. It stands
# on a bench with a plate, so that orbits do not distract: ``axes = "local"`` is a world without an Earth, with x ahead,
# y left, z up.

(work / "bench.toml").write_text("""\
version = 1
name    = "A lidar of my own on the bench"
seed    = 4

[world]
axes = "local"

[time]
start_utc     = 2024-09-17T12:00:00Z
duration_s    = 4
frame_rate_hz = 10                      # 40 frames that differ by their noise alone

[[target]]
name     = "plate"
model    = "plate"                      # 4 m x 4 m, Lambertian 0.30
motion   = { type = "fixed", position_m = [1000, 0, 0] }
attitude = { type = "look_at", at = "follower" }

[follower]
motion   = { type = "fixed", position_m = [0, 0, 0] }

[lidar.laser]
wavelength_nm  = 1064
energy_mj      = 20
pulse_fwhm_ns  = 6
divergence_deg = 2.0                    # full angle of a square beam, equal to the field

[lidar.receiver]
fov_deg      = 2.0
aperture_mm  = 50
transmission = 0.6                      # the whole path, out and back
n_rows       = 64
n_cols       = 64

[lidar.detector]
type               = "gsfl"             # the whole signal chain
quantum_efficiency = 0.7
""")
bench = rl.Scenario.load(work / "bench.toml")

# %%
# How far does it see?
# --------------------
#
# ``budget`` answers in closed form, for a pixel that the target fills. With the pulse energy E, the reflectance ρ, the
# area A of the aperture and the transmission η, the photons that return to a pixel are
#
# .. code-block:: text
#
#    N = E / (h ν) / (number of pixels)  ·  ρ / π  ·  A η / R²
#
# They fall with the square of the range R, not with its fourth power: only the way back thins the light, because a
# pixel sees a larger patch of the target farther away.

shell("rso-lidar budget bench.toml --range 200m:3km -o budget.png")
Image.open(work / "budget.png")

# %%
# Photons fall with the square of the range, and the probability of detection falls from one to zero over a third of its
# reach. The precision ends at 5 cm near by, which is the timing jitter of the pixels. Far away the noise of the
# amplifier decides.
#
# In Python the budget is an object with arrays.

curve = rl.budget(bench, range_m=np.linspace(1000.0, 3000.0, 81)).curves[0]
print(f"detected with 95 % up to {curve.max_range_m:.0f} m")

# %%
# Check it with flashes
# ---------------------
#
# A closed form is a promise. Fly the plate at several ranges, and count. The pixels in the middle of the plate are
# filled, and each of the 40 frames has noise of its own.

measured = []
for range_m in (1400.0, 1700.0, 1850.0, 2000.0, 2150.0, 2400.0, 2700.0):
    plate = bench.target[0].replace(motion=rl.Fixed(position_m=(range_m, 0, 0)))
    frames = list(rl.simulate(bench.replace(target=(plate,))))
    filled = frames[0].labels.filled_fraction > 0.999
    hits = np.mean([frame.valid[filled].mean() for frame in frames])
    trials = filled.sum() * len(frames)
    measured.append((range_m, hits, np.sqrt(max(hits * (1 - hits), 0.25 / trials) / trials), filled.sum()))
    print(f"{range_m:5.0f} m: {filled.sum():3d} filled pixels, detected in {hits:.3f} of flashes")

# %%

figure = Figure(figsize=(8, 4.2), layout="constrained")
axes = figure.subplots()
axes.plot(curve.range_m, curve.detection_probability, label="link budget, closed form")
ranges_m, hits, sigma, _ = np.array(measured).T
axes.errorbar(ranges_m, hits, 2 * sigma, fmt="o", label="simulated flashes, 2 sigma")
axes.set_xlabel("range [m]")
axes.set_ylabel("probability of detection")
axes.legend()
figure

# %%
# The dots are the whole simulation: rays, photons, pulse, photoelectrons, amplifier, trigger. The line is the budget.
# Where they agree, you may trust the fast answer; that is how the package tests itself.
#
# What limits the reach is the threshold. It must be so high that noise crosses it seldom. Lower it by a tenth, and you
# gain 5 % of reach, and twenty times the false alarms. Lower it by a fifth, and nothing more is gained: a pixel that
# has triggered on noise misses the target behind it.

for electrons in (6242.8, 5600.0, 5000.0):
    trigger = bench.lidar.detector.trigger.replace(threshold_electrons=electrons)
    eager = bench.lidar.replace(detector=bench.lidar.detector.replace(trigger=trigger))
    budget = rl.budget(eager, range_m=(400.0, 3000.0))
    print(f"threshold {electrons:6.0f} electrons: 95 % up to {budget.curves[0].max_range_m:5.0f} m, "
          f"{budget.false_alarms_per_frame:8.1f} false alarms a frame")  # fmt: skip

# %%
# A detector of your own
# ----------------------
#
# If your detector works differently, write it. A detector is any object with a method ``detect`` and the attribute
# ``traits``. It is given the light of one flash, a record ``photons``, and random numbers. It returns a reading: range,
# intensity and saturation, an array each.
#
# - ``photons.photons``: expected photons of each *return*, which is what one ray brings back;
# - ``photons.cluster``: which returns arrive as one pulse; ``cluster_pixel`` is the pixel of each pulse, near pulses
#   first;
# - ``photons.delay_s``: two-way travel time.
#
# This one counts photoelectrons and starts a clock at a threshold. It has dark counts, and a timing jitter that falls
# with the square root of the signal, as that of an ideal counter does.


@dataclass(frozen=True)
class PhotonCounter:
    """A threshold on photoelectrons with a clock."""

    efficiency: float = 0.3
    dark_electrons: float = 0.5  # mean per pixel and flash
    threshold: int = 8  # electrons
    jitter_s: float = 2.5e-9  # of one electron

    @property
    def traits(self):
        """Say what a scenario has to know of the detector."""
        return rl.detector.DetectorTraits(sees_to_m=5000.0, threshold_photons=self.threshold / self.efficiency)

    def detect(self, photons, rng):
        """Return the reading of one flash, and no stored waveforms."""
        light = np.bincount(photons.cluster, photons.photons)
        delay_s = np.bincount(photons.cluster, photons.photons * photons.delay_s) / np.maximum(light, 1e-30)
        electrons = rng.poisson(self.efficiency * light + self.dark_electrons)
        found = np.flatnonzero(electrons >= self.threshold)
        pixel, first = np.unique(photons.cluster_pixel[found], return_index=True)  # the nearest pulse of a pixel
        chosen = found[first]
        timed_s = delay_s[chosen] + rng.normal(size=chosen.size) * self.jitter_s / np.sqrt(electrons[chosen])
        range_m = np.full(photons.shape, np.nan)
        counts = np.zeros(photons.shape, np.uint16)
        range_m.flat[pixel] = timed_s * rl.units.RANGE_PER_DELAY_M_S
        counts.flat[pixel] = np.minimum(electrons[chosen], 65_535)
        return rl.records.Reading(range_m, counts, np.zeros(photons.shape, np.uint8)), None


counting = bench.replace(lidar=bench.lidar.replace(detector=PhotonCounter()))
frame = next(rl.simulate(counting))
print(f"{frame.valid.sum()} returns at {np.nanmedian(frame.range_m):.2f} m")

# %%
# The object takes the place of the part, and everything else works as before: frames, truth, labels, recordings,
# studies. What it returns is checked: a reading of the wrong shape or with a negative range is an error that names your
# class.
#
# The result
# ----------
#
# Both detectors behind the same lens. The photons that arrive are labels, so one may ask what each makes of them.

figure = Figure(figsize=(9.5, 4), layout="constrained")
left, right = figure.subplots(1, 2)
for name, detector in (("signal chain", bench), ("photon counter", counting)):
    light, share, spread_cm = [], [], []
    for range_m in (500.0, 1000.0, 1500.0, 2000.0, 3000.0, 4000.0):
        plate = detector.target[0].replace(motion=rl.Fixed(position_m=(range_m, 0, 0)))
        frames = list(rl.simulate(detector.replace(target=(plate,))))
        on = frames[0].labels.filled_fraction > 0.5
        error_m = np.array([(frame.range_m - frame.labels.range_m)[on] for frame in frames])
        light.append(np.median(frames[0].labels.photons[on]))
        share.append(np.isfinite(error_m).mean())
        spread_cm.append(100 * np.nanstd(error_m) if share[-1] > 0.2 else np.nan)
    left.semilogx(light, share, "o-", label=name)
    right.loglog(light, spread_cm, "o-", label=name)
left.set_ylabel("share of pixels that report")
right.set_ylabel("spread of range [cm]")
for axes in (left, right):
    axes.set_xlabel("photons on a pixel")
left.legend()
figure

# %%
# The counter reports every pixel down to 160 photons. The chain needs a thousand, because the noise of its amplifier
# sets the threshold. The spread of the counter falls with the square root of the light, because that is what we wrote.
# That of the chain ends at 5 cm, the timing jitter of its pixels. **You have measured two instruments on one bench, one
# of them your own.**
#
# Exercises
# ---------
#
# 1. Twice the aperture or four times the energy: which gives more reach?
#
#    .. dropdown:: Answer
#
#       The same. Photons go with energy and with the *square* of the aperture, so both give four times the light, and
#       twice the range.
#
#       .. code-block:: python
#
#          for setting in ("lidar.laser.energy_mj=80", "lidar.receiver.aperture_mm=100"):
#              print(setting, rl.budget(rl.Scenario.load(work / "bench.toml", (setting,))).curves[0].max_range_m)
#
# 2. Fly the counter past the rocket stage of step 2.
#
#    .. dropdown:: Answer
#
#       .. code-block:: python
#
#          from rso_lidar.shipped import shipped
#
#          inspection = rl.Scenario.load(shipped() / "examples" / "tumbling_inspection.toml")
#          lidar = inspection.lidar.replace(detector=PhotonCounter())
#          print(next(rl.simulate(inspection.replace(lidar=lidar))).valid.sum(), "returns")
#
# 3. Give the counter false alarms: pixels without light whose dark electrons reach the threshold report a random range.
#
#    .. dropdown:: Answer
#
#       In ``detect``, after the returns of the target:
#
#       .. code-block:: python
#
#          dark = rng.poisson(self.dark_electrons, photons.shape) >= self.threshold
#          dark &= np.isnan(range_m)
#          range_m[dark] = rng.uniform(1.0, 5000.0, dark.sum())
#          counts[dark] = self.threshold
#
#       With half an electron in the mean and a threshold of 8 that is one pixel in ten million flashes. Lower the
#       threshold to 3, and one pixel in seventy is false.
#
# There is a shipped detector for single photons, too: ``type = "geiger"``. Go on with step 5: a tracker of your own.
