"""Small recordings in the form of PixSet, of a camera that equations here invent: no code of the package makes them."""

import io
import pickle
import zipfile

import numpy as np

SAMPLE_NS = 1.25
CHANNELS, SAMPLES, FIRST_M = 96, 256, -22.7  # the range of the first sample: 121 samples before emission
NOISE_COUNTS = {"low": 6.0, "high": 20.0}
SMOOTHED = np.array([1.0, 2.0, 1.0])  # of white noise: neighbours have the correlation 4/6, the next 1/6
FWHM_NS, RATIO, TOP_COUNTS = 15.0, 10.0, 6000


def make_flash(seed):
    """Return what the pickle of one flash holds: a Gaussian pulse in each channel, at some range and of some strength."""
    rng = np.random.Generator(np.random.Philox(seed))
    time_ns = np.arange(SAMPLES) * SAMPLE_NS
    middle_ns = rng.uniform(200.0, 240.0, CHANNELS)[:, None]
    shape = np.exp(-4.0 * np.log(2.0) * ((time_ns - middle_ns) / FWHM_NS) ** 2)
    strength = np.geomspace(150.0, 4000.0, CHANNELS)[:, None]  # of the low gain; most clip in the high gain
    flash = {"timestamp": 1591815129487396 + seed}
    for gain, factor in (("low", 1.0), ("high", RATIO)):
        white = rng.standard_normal((CHANNELS, SAMPLES + 2))
        noise = sum(weight * white[:, k : k + SAMPLES] for k, weight in enumerate(SMOOTHED))
        signal = factor * strength * shape + NOISE_COUNTS[gain] * noise / np.sqrt((SMOOTHED**2).sum())
        offset = rng.integers(-1200, 500, (CHANNELS, 1))
        counts = np.rint(np.minimum(signal, TOP_COUNTS)) + offset
        counts[:, :3] = counts[:, 3:4]  # copies fill the start
        flash[gain] = {
            "data": counts.astype(np.int16),
            "time_base_delays": FIRST_M + rng.normal(0.0, 0.03, CHANNELS),
            "distance_scaling": 0.18737028625,
        }
    return flash


def write_pickles(path, contents, protocol=2):
    """Write a ZIP file with numbered pickles and times, as recordings have it."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("timestamps.csv", "".join(f"{k}\n" for k in range(len(contents))))
        for number, content in enumerate(contents):
            blob = content if isinstance(content, bytes) else pickle.dumps(content, protocol)
            archive.writestr(f"{number:08d}.pkl", blob)
    return path


def write_recording(folder, flashes=4, change=lambda flash: flash, protocol=2):
    """Write the waveforms of a recording into a folder, each flash changed by a function."""
    folder.mkdir(exist_ok=True)
    write_pickles(folder / "pixell_bfc_ftrr.zip", [change(make_flash(k)) for k in range(flashes)], protocol)
    return folder


class Bomb:
    """An object whose pickle would run a command where it is read."""

    def __reduce__(self):
        return print, ("run",)


def dump_as_numpy_1(content):
    """Return a pickle in the words of NumPy 1, in which recordings are published."""
    buffer = io.BytesIO()
    pickle.Pickler(buffer, 2).dump(content)
    return buffer.getvalue().replace(b"numpy._core.multiarray", b"numpy.core.multiarray")
