"""What a trade study asks: its file, its points, and what it refuses."""

import itertools

import numpy as np
import pytest

from rso_lidar.errors import ScenarioError
from rso_lidar.scenario import Scenario
from rso_lidar.study import Study
from rso_lidar.study.trades.definition import MOST_ROWS, write_toml_value
from rso_lidar.study.trades.plan import draw_shares, list_points, list_settings
from tests.study.trades.trade_for_tests import STUDY, folder_with

HEAD = """
version = 1
name = "n"
scenario = "bench.toml"
merits = ["detection_fraction"]
"""
ENERGY = '[[axis]]\nfield = "lidar.laser.energy_mj"\n'
BEAM = '[[axis]]\nfield = "lidar.laser.divergence_deg"\n'


def test_a_grid_holds_every_combination_the_last_axis_fastest():
    study = Study.loads(f'{HEAD}{ENERGY}values = [5, 20]\n{BEAM}low = 1\nhigh = 4\ncount = 3\nscale = "log"')
    assert list_points(study) == list(itertools.product([5, 20], [1.0, 2.0, 4.0]))
    assert study.n_rows == 6


def test_a_grid_of_one_value_is_its_lower_end():
    assert list_points(Study.loads(f"{HEAD}{ENERGY}low = 3\nhigh = 4\ncount = 1")) == [(3.0,)]


@pytest.mark.parametrize("n", [1, 7, 50])
def test_a_latin_hypercube_has_one_point_in_each_stratum_of_each_axis(n):
    study = Study.loads(
        f'{HEAD}seed = 3\nsampling = {{ type = "latin_hypercube", points = {n} }}\n'
        f'{ENERGY}low = 1\nhigh = 100\nscale = "log"\n{BEAM}low = 0.5\nhigh = 2.5'
    )
    drawn = draw_shares(study)
    assert [sorted((column * n).astype(int).tolist()) for column in drawn.T] == [list(range(n))] * 2
    energy, beam = np.array(list_points(study)).T  # and the values lie where the shares say
    assert energy == pytest.approx(100.0 ** drawn[:, 0], rel=1e-11)  # twelve digits are kept
    assert beam == pytest.approx(0.5 + 2.0 * drawn[:, 1], rel=1e-11)


def test_the_scenario_is_found_from_the_study_s_folder_alone(text, tmp_path, monkeypatch):
    monkeypatch.chdir(folder_with(tmp_path, text).parent)
    (tmp_path / "below").mkdir()
    asked = STUDY.replace("bench.toml", "../bench.toml")
    assert Study.loads(asked, folder=tmp_path / "below").base().name == "a plate on a bench"
    with pytest.raises(ScenarioError, match=r"no file 'bench.toml' in \S+below; give its path from the study"):
        Study.loads(STUDY, folder=tmp_path / "below").base()


def test_drawn_points_depend_on_the_seed_alone():
    text = f'{HEAD}seed = %d\nsampling = {{ type = "random", points = 9 }}\n{ENERGY}low = 1\nhigh = 2\n'
    same, again, other = (list_points(Study.loads(text % seed)) for seed in (4, 4, 5))
    assert same == again
    assert not set(same) & set(other)
    assert all(1.0 <= value < 2.0 for (value,) in same)


def test_values_are_drawn_evenly():
    study = Study.loads(
        f'{HEAD}sampling = {{ type = "latin_hypercube", points = 30 }}\n[[axis]]\nfield = "target.plate.model"\n'
        'values = ["plate", "sphere", "tdrs"]'
    )
    drawn = [value for (value,) in list_points(study)]
    assert {value: drawn.count(value) for value in set(drawn)} == {"plate": 10, "sphere": 10, "tdrs": 10}


def test_several_fields_take_one_value_or_each_their_own():
    both = '[[axis]]\nfield = ["lidar.laser.divergence_deg", "lidar.receiver.fov_deg"]\n'
    study = Study.loads(f"{HEAD}{both}values = [2.0, [1.0, 1.5]]")
    assert [list_settings(study, point) for point in list_points(study)] == [
        {"lidar.laser.divergence_deg": "2", "lidar.receiver.fov_deg": "2"},
        {"lidar.laser.divergence_deg": "1", "lidar.receiver.fov_deg": "1.5"},
    ]


def test_values_arrive_in_the_scenario_as_they_are(text):
    """Whole numbers, texts with quotes, lists and tables: what TOML says of a value is read back as that value."""
    changes = {
        "name": 'a "plate"\nat 1 km',
        "lidar.receiver.n_rows": 16.0,
        "target.plate.motion.position_m": [500, 0.25, -0.0],
        "target.plate.material": {"type": "phong", "diffuse": 0.25, "specular": 0.5, "exponent": 3},
    }
    scenario = Scenario.loads(
        text, settings=tuple(f"{field}={write_toml_value(value)}" for field, value in changes.items())
    )
    assert scenario.name == changes["name"]
    assert scenario.lidar.receiver.n_rows == 16
    assert scenario.target[0].motion.position_m == (500.0, 0.25, 0.0)
    assert scenario.target[0].material.specular == 0.5


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (f"{ENERGY}values = []", r"axis\[0\].values: is empty"),
        (f"{ENERGY}values = 3", "needs a list of values"),
        (f"{ENERGY}values = [1, nan]", "nan is not a finite number"),
        (f"{ENERGY}values = [[1, inf]]", "inf is not a finite number"),
        (f"{ENERGY}values = [1, 1.0]", "contains a value twice"),
        (f"{ENERGY}values = [1]\nlow = 1", "has values and low"),
        (f'{ENERGY}values = [1]\nscale = "log"', "has values and scale"),
        (f"{ENERGY}low = 1", "needs values, or low and high"),
        (f"{ENERGY}low = 2\nhigh = 2\ncount = 2", r"low \(2\) is not below high"),
        (f'{ENERGY}low = 0\nhigh = 2\ncount = 2\nscale = "log"', "a log scale needs low above 0"),
        (f"{ENERGY}low = 1\nhigh = nan\ncount = 2", r"axis\[0\].high"),
        (f"{ENERGY}low = 1\nhigh = 2", "a grid needs count"),
        (f"{ENERGY}low = 1\nhigh = 2\ncount = 0", r"axis\[0\].count"),
        (f"{ENERGY}values = [1]\n{ENERGY}values = [2]", r"axis\[1\].field: 'lidar.laser.energy_mj' is an axis already"),
        (f"{ENERGY}low = 1\nhigh = 2\ncount = {MOST_ROWS + 1}", "points and seeds are more than"),
        ('[[axis]]\nfield = ["a", "b"]\nvalues = [[1, 2, 3]]', "not one value for each of 2 fields"),
        ('[[axis]]\nfield = ""\nvalues = [1]', r"axis\[0\].field"),
        ("axis = []", "axis: is empty"),
        ("", "axis: is missing"),
        (f'sampling = {{ type = "grid", points = 3 }}\n{ENERGY}values = [1]', "sampling: unknown key 'points'"),
        (f'sampling = {{ type = "random", points = 0 }}\n{ENERGY}values = [1]', "sampling.points"),
        (f'sampling = {{ type = "random", points = 3 }}\n{ENERGY}low = 1\nhigh = 2\ncount = 3', "count: is for a grid"),
        (f'sampling = {{ type = "latin" }}\n{ENERGY}values = [1]', "did you mean 'latin_hypercube'"),
        (f'frames = "1-5"\n{ENERGY}values = [1]', "frames: needs text such as"),
        (f"frames = [0, 1.5]\n{ENERGY}values = [1]", "frames: needs text such as"),
        (f"frames = [-1]\n{ENERGY}values = [1]", "frames: needs text such as"),
        ('seeds = 2\n[[axis]]\nfield = "seed"\nvalues = [1]', "'seed' is an axis already"),
        (f"report = {{ pictures = 99 }}\n{ENERGY}values = [1]", "report.pictures"),
    ],
)
def test_refused(body, said):
    with pytest.raises(ScenarioError, match=said) as error:
        Study.loads(HEAD + body)
    assert str(error.value).startswith("study: ")
    assert "more)" not in str(error.value)  # one mistake is told as one


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ('["detection_fracton"]', "did you mean 'detection_fraction'"),
        ('["range_rms_m", "range_rms_m"]', "given twice"),
        ("[]", "merits"),
    ],
)
def test_merits_refused(names, said):
    text = HEAD.replace('["detection_fraction"]', names)
    with pytest.raises(ScenarioError, match=said):
        Study.loads(f"{text}{ENERGY}values = [1]")
