"""Trades worked through: against a closed form, whatever the workers, cut off and gone on."""

import errno
import math
import os
from dataclasses import replace

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import RunError, ScenarioError
from rso_lidar.mission_analysis.budgets.pixel_light import compute_photons
from rso_lidar.scenario import Scenario
from rso_lidar.study import Study, trade
from rso_lidar.study.trades.execution import RowFile, identify
from rso_lidar.study.trades.plan import make_trade_plan
from rso_lidar.study.trades.ranking import (
    choose_pictured,
    find_pareto_front,
    rank_points,
    shorten_places,
    summarize_trade,
)
from rso_lidar.study.trades.report import write_report
from tests.study.trades.trade_for_tests import STUDY, folder_with

WALL = """
version = 1
name = "a wall that fills the field"
seed = 5

[world]
axes = "local"

[time]
start_utc = 2024-09-17T12:00:00Z
duration_s = 1
frame_rate_hz = 4

[[target]]
name = "wall"
model = "plate"
size_m = 200
material = { type = "lambertian", reflectance = 0.30 }
motion = { type = "fixed", position_m = [3000, 0, 0] }
attitude = { type = "look_at", at = "follower" }

[follower]
motion = { type = "fixed", position_m = [0, 0, 0] }

[lidar.receiver]
fov_deg = 2.5
f_number = 2.8
n_rows = 32
n_cols = 32
rays_per_pixel = 4

[lidar.detector]
type = "empirical"
false_alarms_per_s = 0
"""
ASKED = """
version = 1
name = "Energy and divergence on a wall"
scenario = "wall.toml"
seeds = 2
merits = ["detection_fraction"]

[[axis]]
field = "lidar.laser.energy_mj"
values = [35, 50, 75]

[[axis]]
field = "lidar.laser.divergence_deg"
values = [2.5, 2.75, 3.0]
"""


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wall")
    (folder / "wall.toml").write_text(WALL, encoding="utf-8")
    (folder / "study.toml").write_text(ASKED, encoding="utf-8")
    return trade(folder / "study.toml")


def test_detection_of_a_wall_is_that_of_the_closed_form(wall):
    """Each of 32 x 32 pixels sees the same wall: a binomial draw of the probability at its photons, by the link budget.

    Off the boresight light falls with the cosine's fourth power, by 0.06 % in the mean over the field; the probability
    changes by at most 0.019 for a per cent of light, so by 0.0012.
    """
    camera = Scenario.loads(WALL).instrument
    probability, seen = [], []
    n = 32 * 32 * 4 * 2
    for point, (energy_mj, beam_deg) in enumerate(wall.plan.points):
        laser = camera.laser.replace(energy_mj=float(energy_mj), divergence_deg=beam_deg)
        photons, _ = compute_photons(laser, camera.receiver, rl.Lambertian(reflectance=0.3), 0.0, np.array([3000.0]))
        probability.append(float(camera.detector.detection_probability(photons)[0]))
        seen.append(float(wall.of_points("detection_fraction")[0][point]))
    assert min(probability) < 0.2 < 0.9 < max(probability)  # or little is tried
    for expected, got in zip(probability, seen, strict=True):
        spread = math.sqrt(expected * (1.0 - expected) / n)
        assert abs(got - expected) < 4.1 * spread + 0.0012  # 4.1 sigma: one in 2700 that one of nine fails by chance


def test_rows_are_points_and_seeds_in_order(wall):
    table = wall.table
    assert table["row"].tolist() == list(range(18))
    assert table["seed"].tolist() == [5, 6] * 9
    assert table["lidar.laser.energy_mj"].tolist() == [35.0] * 6 + [50.0] * 6 + [75.0] * 6
    assert set(table["error"].tolist()) == {""}
    mean, spread = wall.of_points("detection_fraction")
    pairs = table["detection_fraction"].reshape(-1, 2)
    assert mean == pytest.approx(pairs.mean(axis=1))
    assert spread == pytest.approx(pairs.std(axis=1, ddof=1))
    assert spread[1] > 0.0  # another seed, another noise


def test_a_row_is_the_run_that_its_settings_make(wall):
    """What a report prints behind --set makes the row again."""
    changes = tuple(f"{field}={value}" for field, value in wall.plan.settings(13).items())
    assert "seed=6" in changes
    frames = list(rl.simulate(Scenario.loads(WALL, settings=changes), threads=1))
    assert wall.table["detection_fraction"][13] == pytest.approx(np.mean([frame.valid for frame in frames]))


def test_ranking(wall):
    mean = wall.of_points("detection_fraction")[0]
    order = rank_points(wall, "detection_fraction")
    assert order[0] == 6  # 75 mJ within 2.5 degrees
    assert np.all(np.diff(mean[order]) <= 0.0)
    assert [point for point, _ in choose_pictured(wall)] == [order[0], order[3], order[5], order[8]]
    assert np.flatnonzero(find_pareto_front(wall)).tolist() == [6]
    assert "best" in summarize_trade(wall)[1] and "energy_mj 75, divergence_deg 2.5" in summarize_trade(wall)[1]


LUCKY = (
    ASKED.replace("[35, 50, 75]", "[1, 50, 75]")
    .replace("[2.5, 2.75, 3.0]", "[2.5]")
    .replace('["detection_fraction"]', '["range_rms_m", "false_returns"]')
)


@pytest.fixture(scope="module")
def lucky(tmp_path_factory):
    """Return a trade whose point of least light has the least error: of the few pixels that report, made up here."""
    folder = tmp_path_factory.mktemp("lucky")
    (folder / "wall.toml").write_text(WALL, encoding="utf-8")
    (folder / "study.toml").write_text(LUCKY, encoding="utf-8")
    made = trade(folder / "study.toml")
    assert made.of_points("detection_fraction")[0][0] < 0.05 < 0.9 < made.of_points("detection_fraction")[0][1]
    return replace(made, table=made.table | {"range_rms_m": np.repeat([0.001, 0.2, 0.1], 2)})


def test_a_point_where_little_is_detected_is_not_the_best(lucky):
    """20 photons on a pixel of the first point, 1000 on the second: the former is not found, whatever its error."""
    assert rank_points(lucky, "range_rms_m").tolist() == [2, 1]
    assert rank_points(lucky, "false_returns").tolist() == [0, 1, 2]  # hangs on no detection: all are alike
    assert np.flatnonzero(find_pareto_front(lucky)).tolist() == [2]
    assert [point for point, _ in choose_pictured(lucky)] == [2, 1]
    assert lucky.table["detected"].tolist() == [0, 0, 1, 1, 1, 1]
    assert set(lucky.table["min_detection_fraction"].tolist()) == {0.5}
    lines = summarize_trade(lucky)
    assert "best      0.1 at row 4" in lines[1]
    why = "1 of 3 points are not ranked in range_rms_m: detection_fraction below 0.5 (min_detection_fraction)"
    assert lines[-1] == why
    assert any(line.startswith("False returns") and "so that none is best" in line for line in lines)
    page = write_report(lucky)
    assert why in page and "Points that are not ranked" in page


def test_the_least_detection_is_settable_down_to_none_and_beyond_all(lucky):
    ranked = replace(lucky, study=lucky.study.replace(min_detection_fraction=0.0))
    assert rank_points(ranked, "range_rms_m").tolist() == [0, 2, 1]
    assert not any("not ranked" in line for line in summarize_trade(ranked))
    none = replace(lucky, study=lucky.study.replace(min_detection_fraction=1.0))
    none.table["detection_fraction"][:] = [0.0, 0.0, 0.3, 0.3, 0.25, 0.25]
    lines = summarize_trade(none)
    assert rank_points(none, "range_rms_m").size == 0 and not find_pareto_front(none).any()
    assert "ranks no point" in lines[1]
    assert lines[-1].startswith("no point is ranked in range_rms_m: all 3 have a detection_fraction below 1")
    assert lines[-1].endswith("0.3 at most")
    assert "no point is ranked" in write_report(none)


def test_the_least_detection_ranks_rows_and_makes_none_anew(tmp_path):
    """Another limit goes on from the rows that are there; it is in the table only where something hangs on detection."""
    (tmp_path / "wall.toml").write_text(WALL, encoding="utf-8")
    (tmp_path / "study.toml").write_text(LUCKY, encoding="utf-8")
    study = Study.load(tmp_path / "study.toml")
    names = {identify(*make_trade_plan(study.replace(min_detection_fraction=share))) for share in (0.5, 0.1)}
    assert len(names) == 1
    with pytest.raises(ScenarioError, match=r"study\.toml: min_detection_fraction"):
        Study.loads("min_detection_fraction = 1.5\n" + LUCKY, where="study.toml")


def test_columns_are_headed_with_as_much_as_tells_them_apart():
    places = ("follower.motion.position_m.1", "lidar.laser.energy_mj", "target.a.material", "target.b.material", "seed")
    assert list(shorten_places(places).values()) == ["position_m.1", "energy_mj", "a.material", "b.material", "seed"]
    assert shorten_places(("material", "target.a.material", "lidar.detector.type")) == {
        "material": "material",
        "target.a.material": "a.material",
        "lidar.detector.type": "detector.type",
    }
    both = ("follower.motion.position_m.1", "target.a.motion.position_m.1")
    assert list(shorten_places(both).values()) == ["follower.motion.position_m.1", "a.motion.position_m.1"]


# ------------------------------------------------------------------------------------------------ errors in points


def test_a_point_that_cannot_be_flown_is_a_row_with_its_reason(text, tmp_path):
    study = STUDY.replace("[5, 20]", "[5, -5]")
    made = trade(folder_with(tmp_path, text, study))
    bad = made.table["lidar.laser.energy_mj"] < 0.0
    assert bad.sum() == 3
    assert all("lidar.laser.energy_mj: should be greater than 0" in why for why in made.table["error"][bad].tolist())
    assert set(made.table["error"][~bad].tolist()) == {""}
    assert np.isnan(made.table["time_in_field_s"][bad]).all() and np.isfinite(made.table["time_in_field_s"][~bad]).all()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("laser.energy_mj", "laser.energy_m", r"axis\[0\].field: lidar.laser.energy_m: .*did you mean 'energy_mj'"),
        ("lidar.laser.energy_mj", "lidar.lazer.energy_mj", r"axis\[0\].field: .*did you mean 'laser'"),
        ("lidar.laser.energy_mj", "target.plane.scale", r"axis\[0\].field: target.plane.scale: no entry 'plane'"),
        ("lidar.laser.energy_mj", "name.first", r"axis\[0\].field: .*is a value, not a table"),
        ("[5, 20]", '[5, "much"]', r"axis\[0\].values: bench.toml: lidar.laser.energy_mj: .*valid number, not 'much'"),
        ("lidar.laser.energy_mj", "lidar.receiver.rays_per_pixel", r"axis\[0\].values: .*integer, not 5.5"),
        ("[5, 20]", "[-5, -20]", "no point can be flown; the first: .*greater than 0, not -5"),
        ("bench.toml", "bensh.toml", "no file 'bensh.toml'"),
        ('"0:4:2"', "[99]", "frames: need ascending numbers"),
        ('name     = "Energy', 'target = "plane"\nname = "Energy', "did you mean 'plate'"),
        ('name     = "Energy', 'set = ["seeds=1"]\nname = "Energy', "unknown key 'seeds'"),
    ],
)
def test_what_is_wrong_at_every_point_is_told_before_anything_runs(text, tmp_path, old, new, said):
    study = STUDY.replace(old, new)
    if "rays_per_pixel" in new:
        study = study.replace("[5, 20]", "[4, 5.5]")
    path = folder_with(tmp_path, text, study)
    with pytest.raises(ScenarioError, match=said):
        make_trade_plan(Study.load(path))


def test_frames_that_a_point_lacks_are_its_error(text, tmp_path):
    study = STUDY.replace("lidar.laser.energy_mj", "time.duration_s").replace("[5, 20]", "[0.2, 2]")
    made = trade(folder_with(tmp_path, text, study.replace('"0:4:2"', "[3]")))
    assert ["frames: need ascending numbers" in why for why in made.table["error"].tolist()] == [True] * 3 + [False] * 3


def test_workers_are_a_number(text, tmp_path):
    with pytest.raises(ScenarioError, match="workers: needs a whole number"):
        trade(folder_with(tmp_path, text), workers=0)


# -------------------------------------------------------------------------------------------- workers, and going on


def test_what_was_cut_off_goes_on_and_ends_the_same(text, tmp_path):
    path = folder_with(tmp_path, text)
    whole = trade(path)
    working = tmp_path / "out.csv"
    plan, base = make_trade_plan(Study.load(path))
    kept = tmp_path / f"out.csv.tmp-{identify(plan, base)}"
    with RowFile(kept, 6).opened() as rows:
        for row in (plan.row(5), plan.row(0)):  # as workers may end
            rows.add(row)
    with kept.open("ab") as file:
        file.write(b'{"row": 1, "seed": 7, "mer')  # a kill in the middle of a line
    counts = []
    again = trade(path, working=working, on_row=lambda done, count: counts.append((done, count)))
    assert counts == [(2, 6), (3, 6), (4, 6), (5, 6), (6, 6)]
    assert {name: repr(values.tolist()) for name, values in again.table.items()} == {
        name: repr(values.tolist()) for name, values in whole.table.items()
    }
    assert whole.save(tmp_path / "a.csv").read_bytes() == again.save(tmp_path / "b.csv").read_bytes()


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        ("study.toml", "[5, 20]", "[5, 21]"),
        ("bench.toml", "seed    = 7", "seed    = 8"),
        ("study.toml", '"0:4:2"', '"0:4"'),
    ],
)
def test_another_study_does_not_go_on_from_it(text, tmp_path, file, old, new):
    path = folder_with(tmp_path, text)
    first = identify(*make_trade_plan(Study.load(path)))
    changed = tmp_path / file
    changed.write_text(changed.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    assert identify(*make_trade_plan(Study.load(path))) != first


def test_an_error_that_is_not_of_the_rows_does_not_blame_them(tmp_path):
    """A report for which there is no room says so itself."""
    full = OSError(errno.ENOSPC, "No space left on device", "report.html")
    with pytest.raises(OSError, match=r"No space left on device: 'report.html'"):
        with RowFile(tmp_path / "out.csv.tmp-0", 1).opened():
            raise full


def test_a_row_that_cannot_be_kept_names_the_file(tmp_path, monkeypatch):
    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with RowFile(tmp_path / "out.csv.tmp-0", 1).opened() as rows:
        monkeypatch.setattr("rso_lidar.study.trades.execution.os.fsync", full)
        with pytest.raises(rl.RunError, match=r"out\.csv\.tmp-0: cannot be written \(No space left on device\)"):
            rows.add({"row": 0, "seed": 7, "merits": {}, "error": ""})
    assert not rows.known


def test_only_one_at_a_time(tmp_path):
    with RowFile(tmp_path / "out.csv.tmp-0", 1).opened():
        with pytest.raises(rl.RecordingError, match="another run is writing it"):
            with RowFile(tmp_path / "out.csv.tmp-0", 1).opened():
                pass


def test_a_mesh_that_an_axis_names_is_part_of_what_a_study_is(tmp_path):
    """Rows of one mesh are not taken for those of another of the same name."""
    study = folder_with(
        tmp_path,
        WALL,
        'version = 1\nname = "meshes"\nscenario = "bench.toml"\nmerits = ["pixels_on_target"]\n\n'
        '[[axis]]\nfield = "target.wall.model"\nvalues = ["./box.off", "plate"]\n',
    )
    box = "OFF\n3 1 0\n0 0 0\n0 {0} 0\n0 0 1\n3 0 1 2\n"
    names = []
    for side in (1, 2, 1):
        (tmp_path / "box.off").write_text(box.format(side))
        names.append(identify(*make_trade_plan(Study.load(study))))
    assert names[0] == names[2] != names[1]


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="the system opens no file without following links")
def test_rows_are_not_kept_through_a_link(tmp_path):
    victim, kept = tmp_path / "victim", tmp_path / "out.csv.tmp-0"
    victim.write_text("precious\n")
    kept.symlink_to(victim)
    with pytest.raises(RunError, match=r"it is a symbolic link\); remove it and run again"), RowFile(kept, 1).opened():
        raise AssertionError("opened")
    assert victim.read_text() == "precious\n"
