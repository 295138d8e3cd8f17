import numpy as np
import pytest
from scipy import stats

from rso_lidar.dataset import compare
from rso_lidar.dataset.scoring.comparison import correct_by_holm, find_exchange_probability
from rso_lidar.dataset.scoring.score_figures import _SPAN, draw_comparison
from rso_lidar.errors import RsoLidarError
from tests.dataset.scoring.frames import CLASSES, guess_classes, make_card, make_truth


def of_name(comparison, name):
    return next(change for change in comparison.changes if change.name == name)


def test_the_exchange_test_is_mcnemars_for_single_frames():
    rng = np.random.default_rng(0)
    for lost, won in ((0, 0), (4, 0), (9, 3), (30, 41)):
        differences = rng.permutation(np.concatenate([np.full(lost, -1), np.full(won, 1), np.zeros(50, int)]))
        expected = stats.binomtest(won, lost + won, 0.5, alternative="less").pvalue if lost + won else 1.0
        assert find_exchange_probability(differences) == pytest.approx(expected)


def test_the_exchange_test_counts_all_signs():
    sizes = np.array([3, 1, 2, 5])
    signs = np.array(np.meshgrid(*[[-1, 1]] * 4)).reshape(4, -1)
    for pattern in ([-1, -1, -1, -1], [1, -1, -1, 1], [1, 1, 1, 1]):
        found = float((sizes * pattern).sum())
        assert find_exchange_probability(sizes * pattern) == pytest.approx(np.mean(sizes @ signs <= found))


def test_many_differences_are_nearly_normal(monkeypatch):
    differences = np.random.default_rng(1).choice([-2, -1, 0, 1, 2], 400)
    exact = find_exchange_probability(differences)
    monkeypatch.setattr("rso_lidar.dataset.scoring.comparison._MOST_EXACT", 10)
    assert find_exchange_probability(differences) == pytest.approx(exact, abs=0.02)


def test_holms_correction_never_lowers_and_keeps_the_order():
    p = np.array([0.2, 0.001, 0.03, 0.6, 0.012])
    corrected = correct_by_holm(p)
    assert np.all(corrected >= p) and np.array_equal(np.argsort(corrected, kind="stable"), np.argsort(p))
    assert corrected.min() == pytest.approx(0.005) and corrected[4] == pytest.approx(0.048)
    assert correct_by_holm(np.empty(0)).size == 0


def test_equal_predictions_do_not_differ():
    truth = make_truth(80)
    columns = {"class": guess_classes(truth, 0.7, np.random.default_rng(0))}
    comparison = compare(make_card(truth, columns), make_card(truth, columns))
    change = of_name(comparison, "accuracy")
    assert (change.difference, change.low, change.high, change.verdict) == (0.0, 0.0, 0.0, "no difference")
    assert change.p_worse == change.p_better == 1.0 and not comparison.is_worse
    assert not len(comparison.broken) and not len(comparison.repaired)


def test_frames_that_broke_are_named():
    truth = make_truth(60)
    wrong = np.array(CLASSES)[(truth.class_id + 1) % 3]
    right = np.array(CLASSES)[truth.class_id]
    new = np.where(np.arange(60) < 15, wrong, right)
    old = np.where(np.arange(60) >= 58, wrong, right)
    comparison = compare(make_card(truth, {"class": new}), make_card(truth, {"class": old}))
    assert comparison.broken.tolist() == [*range(15)] and comparison.repaired.tolist() == [58, 59]
    change = of_name(comparison, "accuracy")
    assert change.verdict == "worse" and comparison.is_worse
    assert change.difference == pytest.approx(-13 / 60)
    assert change.p_worse >= stats.binomtest(2, 17, 0.5, alternative="less").pvalue
    back = compare(make_card(truth, {"class": old}), make_card(truth, {"class": new}))
    assert of_name(back, "accuracy").verdict == "better" and not back.is_worse


def test_a_few_frames_of_one_encounter_prove_nothing():
    """Forty frames that broke would be a proof if they were independent; they are two encounters."""
    truth = make_truth(40, draws=20)
    right = np.array(CLASSES)[truth.class_id]
    new = np.where(np.isin(truth.sample, truth.sample[[0, 20]]), np.array(CLASSES)[(truth.class_id + 1) % 3], right)
    change = of_name(compare(make_card(truth, {"class": new}), make_card(truth, {"class": right})), "accuracy")
    assert change.difference == pytest.approx(-0.05) and change.verdict == "no difference"
    assert change.p_worse == pytest.approx(0.25)


def test_a_margin_is_a_loss_that_does_not_matter():
    truth = make_truth(300)
    right = np.array(CLASSES)[truth.class_id]
    new = np.where(np.arange(300) < 15, np.array(CLASSES)[(truth.class_id + 1) % 3], right)
    cards = make_card(truth, {"class": new}), make_card(truth, {"class": right})
    assert compare(*cards).is_worse
    assert not compare(
        *cards, {"accuracy": 0.05, "accuracy_100_pixels": 1.0} if has_strong(cards) else {"accuracy": 0.05}
    ).is_worse
    assert compare(*cards, {"accuracy": 0.01}).is_worse
    with pytest.raises(RsoLidarError, match="did you mean 'accuracy'"):
        compare(*cards, {"acuracy": 0.05})
    with pytest.raises(RsoLidarError, match="not a number from 0"):
        compare(*cards, {"accuracy": -0.05})


def has_strong(cards):
    return any(merit.name == "accuracy_100_pixels" for merit in cards[0].merits)


def test_lower_errors_are_better():
    truth = make_truth(100)
    rng = np.random.default_rng(2)

    def poses(sigma_m):
        position = truth.position_m + sigma_m * rng.normal(size=(100, 3))
        names = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
        return dict(zip(names, np.column_stack([position, truth.quaternion_xyzw]).T, strict=True))

    change = of_name(compare(make_card(truth, poses(0.2)), make_card(truth, poses(0.5))), "translation_error_median")
    assert change.difference < 0 and change.verdict == "better"


def test_what_cannot_be_compared_is_refused():
    truth = make_truth(30)
    classes = {"class": np.array(CLASSES)[truth.class_id]}
    both = classes | {"present": np.ones(30)}
    with pytest.raises(RsoLidarError, match="does not predict presence_average_precision"):
        compare(make_card(truth, classes), make_card(truth, both))
    assert compare(make_card(truth, both), make_card(truth, classes)).changes[0].name == "accuracy"
    other = make_truth(31)
    with pytest.raises(RsoLidarError, match="other frames"):
        compare(make_card(truth, classes), make_card(other, {"class": np.array(CLASSES)[other.class_id]}))


def test_too_few_encounters_are_said():
    truth = make_truth(5, draws=10)
    right, wrong = (np.array(CLASSES)[(truth.class_id + k) % 3] for k in (0, 1))
    change = of_name(compare(make_card(truth, {"class": wrong}), make_card(truth, {"class": right})), "accuracy")
    assert change.verdict == "too few encounters"


def test_the_scatter_of_training_runs_counts():
    """Three runs of each, whose mean differs by less than runs do: no difference, though each frame says so."""
    truth = make_truth(2000)
    rng = np.random.default_rng(4)
    new = [{"class": guess_classes(truth, share, rng)} for share in (0.70, 0.80, 0.90)]
    old = [{"class": guess_classes(truth, share, rng)} for share in (0.74, 0.84, 0.94)]
    several = compare(make_card(truth, *new), make_card(truth, *old))
    assert of_name(several, "accuracy").verdict == "no difference"
    alone = compare(make_card(truth, new[1]), make_card(truth, old[1]))
    assert of_name(alone, "accuracy").verdict == "worse"


def rate_of_worse(trials, drop, draws=1, encounters=80):
    """Return how often the new of two algorithms is called worse, whose accuracy differs by `drop`."""
    worse = 0
    for trial in range(trials):
        rng = np.random.default_rng([trial, draws])
        truth = make_truth(encounters, draws, seed=trial)
        share = np.repeat(rng.beta(4.0, 1.0, encounters), draws)  # what is hard is hard for both
        new, old = ({"class": guess_classes(truth, share - less, rng)} for less in (drop, 0.0))
        worse += compare(*(make_card(truth, one, replicates=200) for one in (new, old))).is_worse
    return worse / trials


@pytest.mark.parametrize("draws", [1, 4])
def test_equal_algorithms_are_seldom_called_worse(draws):
    assert rate_of_worse(150, 0.0, draws) <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 150)  # at a level of 5 %


def test_a_real_loss_is_found():
    assert rate_of_worse(40, 0.2, draws=2) >= 0.9


def test_the_figure_shows_gains_in_half_widths_within_its_span():
    """The old algorithm guesses better: gains are below zero, and far ones end at the edge."""
    rng, truth = np.random.default_rng(3), make_truth(400)
    right, wrong = (guess_classes(truth, share, rng) for share in (0.95, 0.55))
    comparison = compare(make_card(truth, {"class": wrong}), make_card(truth, {"class": right}))
    axes = draw_comparison(comparison).axes[0]
    drawn = [float(container.lines[0].get_xdata()[0]) for container in axes.containers]
    for place, change in zip(drawn, [c for c in comparison.changes if not np.isnan(c.difference)], strict=True):
        half = 0.5 * (change.high - change.low)
        gain = change.difference * (1.0 if change.better == "higher" else -1.0)
        if half > 0.0:
            assert place == pytest.approx(np.clip(gain / half, -_SPAN, _SPAN))
    assert min(drawn) < -1.0
