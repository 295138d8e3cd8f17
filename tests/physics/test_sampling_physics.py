"""Sampling of pixels against polygons in the image, or dense lattices of rays: scenes made for it, and ten spacecraft."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.physics.sampling_scenes import (
    ATTITUDES,
    CRAFT,
    SAMPLING_ERRORS,
    SCENES,
    SceneCase,
    body_on_four_pixels,
    compare,
    craft_case,
    grating,
    half_hidden,
    load_case,
    plate_edge,
    sample,
)

STEP_DEG, STEPS = 0.01, 4
FEW_PIXELS = 30  # lit ones, up to which an rms error or a total is too uncertain to compare


def judge(got, variance, true, sampling_error):
    """Return what is wrong with the photons (pixel) that a sampler found, and with the error that it states."""
    error, label, total = compare(got, true, variance)
    wrong = []
    if error > 1.5 * sampling_error:
        wrong.append(f"a pixel's error is {error:.2%}, over 1.5 times {sampling_error:.0%}")
    if np.count_nonzero(true) > FEW_PIXELS:
        if abs(total) > 0.001:
            wrong.append(f"the light of all pixels is off by {total:+.3%}")
        is_known = 0.7 <= label / error <= 1.5 if error > 0.25 * sampling_error else label < 0.4 * sampling_error
    else:  # one pixel's error is a single draw, which by chance is three times its rms or nothing
        is_known = error / 3.0 <= label <= 1.5 * sampling_error
    if not is_known:
        wrong.append(f"the label says {label:.2%} of an error of {error:.2%}")
    return wrong


@pytest.mark.parametrize("sampling_error", SAMPLING_ERRORS)
@pytest.mark.parametrize("name", SCENES)
def test_the_light_of_pixels_is_known_as_well_as_was_asked_for(name, sampling_error):
    scene, true = load_case(SCENES[name])
    assert not judge(*sample(scene, sampling_error), true, sampling_error)


@pytest.mark.parametrize("sampling_error", SAMPLING_ERRORS)
@pytest.mark.parametrize("attitude", ATTITUDES)
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if r < 500 else n for n, r in CRAFT.items()])
def test_the_light_of_spacecraft_is_known_as_well_as_was_asked_for(name, attitude, sampling_error, shared):
    scene, true = load_case(craft_case(shared, name, attitude))
    assert not judge(*sample(scene, sampling_error), true, sampling_error)


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if r < 500 else n for n, r in CRAFT.items()])
def test_spacecraft_at_the_default_sampling_error(name, shared, validation):
    case = craft_case(shared, name, "random")
    scene, true = load_case(case)
    asked = scene.receiver.sampling_error
    got, variance = sample(scene, asked)
    error, label, total = compare(got, true, variance)
    rows = [
        ("error of a pixel's photons, weighted by light", 0.0, 100.0 * error, 150.0 * asked),
        ("the same error, as the label says", 100.0 * error, 100.0 * label, 100.0 * max(0.5 * error, 0.4 * asked)),
        ("light of all pixels", 100.0, 100.0 * (1.0 + total), 0.1),
    ]
    for what, expected, value, tolerance in rows:
        numbers = {"expected": expected, "got": value, "tolerance": tolerance, "unit": "%"}
        validation(case=f"{name} at {CRAFT[name]} m: {what}", source=case.reference, **numbers)


TURNED = [
    pytest.param(plate_edge, id="plate edge"),
    pytest.param(grating, id="grating", marks=pytest.mark.slow),
    pytest.param(body_on_four_pixels, id="four pixels"),
    pytest.param(lambda turn: half_hidden(turn, turn), id="half hidden"),
]


@pytest.mark.parametrize("start", [Rotation.identity(), Rotation.random(random_state=21)], ids=["aligned", "random"])
@pytest.mark.parametrize("build", TURNED)
def test_a_slight_turn_changes_no_more_light_than_the_label_says(build, start):
    axis = np.array([0.48, 0.6, 0.64])
    totals, true, variances = [], [], []
    for k in range(STEPS + 1):
        turn = Rotation.from_rotvec(k * STEP_DEG * axis, degrees=True) * start
        scene, photons = load_case(SceneCase(build, (turn,), "exact"))
        got, variance = sample(scene, 0.02)
        totals.append(got.sum())
        true.append(photons.sum())
        variances.append(variance.sum())
    excess = np.maximum(np.abs(np.diff(totals)) - np.abs(np.diff(true)), 0.0)
    assert math.sqrt(np.mean(excess**2)) <= math.sqrt(np.mean(variances))
