"""Small frames kept from before: geometry to 1 um, noise by mean and variance, pixel by pixel.

A frame that changes for a reason is made anew by ``python -m tests.golden.remake``.
"""

import numpy as np
import pytest
from scipy import stats

from tests.golden.remake import FOLDER, GEOMETRY, SCENES, made, noise
from tests.reference.detector.whole_chain import PATHS, computing

DRAWS = 200
ALPHA = 1e-3  # of a false alarm in one test of all pixels (Sidak)
REMAKE = "if the change is meant: python -m tests.golden.remake"


@pytest.fixture(scope="module", params=[(scene, path) for scene in SCENES for path in PATHS], ids="-".join)
def pair(request):
    """The golden arrays of a scene, and its frame made now, compiled and by the reference."""
    scene, path = request.param
    with np.load(FOLDER / f"{scene}.npz") as file:
        golden = {name: file[name] for name in file.files}
    with computing(path):
        yield golden, *made(scene)


def test_the_frames_show_what_they_are_meant_to(pair):
    """Sky and target, pixels of two clusters, found always, sometimes and hardly ever."""
    golden, *_ = pair
    found = golden["noise_found"] / golden["draws"]
    on_target = golden["target"] >= 0
    assert 50 < on_target.sum()
    assert np.sum((found > 0.05) & (found < 0.95)) > 10 and np.sum(found > 0.999) > 10
    assert np.nanmin(golden["range_m"]) > 100


def test_geometry(pair):
    golden, labels, _, _ = pair
    tolerance = dict.fromkeys(GEOMETRY, 0.0) | {
        "range_m": 1e-6,
        "first_range_m": 1e-6,
        "cos_incidence": 1e-6,
        "photons": 1e-5,
        "filled_fraction": 1e-6,
    }
    for name in GEOMETRY:
        old, new = golden[name].astype(float), labels[name].astype(float)
        assert np.array_equal(np.isnan(old), np.isnan(new)), f"{name}: {REMAKE}"
        scale = np.maximum(np.abs(old), 1.0) if name == "photons" else 1.0
        off = np.nan_to_num(np.abs(new - old) / scale)
        worst = np.unravel_index(np.argmax(off), off.shape)
        assert off.max() <= tolerance[name], (
            f"{name} differs in {np.sum(off > tolerance[name])} pixels, most at {worst}: was {old[worst]!r}, "
            f"is {new[worst]!r}; {REMAKE}"
        )


def least_p(p):
    """Return the least p-value of many, corrected for their number (Sidak)."""
    return -np.expm1(p.size * np.log1p(-np.clip(p.min(), 0, 1 - 1e-16)))


def test_noise(pair):
    """Detection by Fisher's exact test; mean by z, variance by F, where both saw enough returns."""
    golden, _, frame, part = pair
    now, before, n = noise(frame, part, DRAWS, seed=3), golden, int(golden["draws"])

    found, was = now["found"], before["noise_found"]
    tested = (found + was > 0) & (found + was < DRAWS + n)
    p = np.array(
        [
            stats.fisher_exact([[a, DRAWS - a], [b, n - b]]).pvalue
            for a, b in zip(found[tested].astype(int), was[tested].astype(int), strict=True)
        ]
    )
    assert least_p(p) > ALPHA, f"detection differs; {REMAKE}"

    saturated = np.abs(now["saturated"] / DRAWS - before["noise_saturated"] / n)
    assert saturated.max() < 0.2
    # With two surfaces the error is one of two Gaussians, and neither z nor F holds.
    enough = (found > 100) & (was > 1000) & (before["cluster_count"] == 1)
    assert enough.sum() > 10
    for name in ("range", "counts"):
        m, k = found[enough], was[enough]
        mean, old_mean = now[name][enough] / m, before[f"noise_{name}"][enough] / k
        variance = (now[f"{name}2"][enough] / m - mean**2) * m / (m - 1)
        old_variance = (before[f"noise_{name}2"][enough] / k - old_mean**2) * k / (k - 1)
        moving = old_variance > 0.5 if name == "counts" else np.ones(len(m), bool)  # clipped counts have none
        z = (mean - old_mean)[moving] / np.sqrt(variance[moving] / m[moving] + old_variance[moving] / k[moving])
        assert least_p(2 * stats.norm.sf(np.abs(z))) > ALPHA, f"mean {name} differs; {REMAKE}"
        ratio = variance[moving] / old_variance[moving]
        f = stats.f(m[moving] - 1, k[moving] - 1)
        assert least_p(2 * np.minimum(f.cdf(ratio), f.sf(ratio))) > ALPHA, f"variance of {name} differs; {REMAKE}"


def test_a_little_more_noise_would_be_seen(pair):
    """The test above can fail: twice the plateau of the range noise, or a threshold 10 % higher, is noticed."""
    golden, labels, frame, part = pair
    louder = part.replace(range_plateau_m=part.range_plateau_m * 2)
    with pytest.raises(AssertionError, match="variance of range differs"):
        test_noise((golden, labels, frame, louder))
    deafer = part.replace(reference_photons=part.reference_photons * 1.1)
    with pytest.raises(AssertionError, match="detection differs"):
        test_noise((golden, labels, frame, deafer))
