"""Trust in FMUs reaches all that flies a scenario, worker processes included, and no more than what it is given to."""

import pickle
from pathlib import Path

import pytest

import rso_lidar as rl
from rso_lidar.cli.parameters import parameters
from rso_lidar.cli.requirements import requirements
from rso_lidar.cli.trade import trade
from rso_lidar.dataset.drawing.plan import make_plan as plan_dataset
from rso_lidar.errors import ScenarioError
from rso_lidar.motion import FmuAttitude
from rso_lidar.study import Study
from rso_lidar.study.trades.plan import make_trade_plan
from tests.dataset.bench_for_tests import SCENARIO, make_spec
from tests.fmi.fmus_for_tests import compile_reference

pytest.importorskip("fmpy", reason="the extra `fmi` is not installed")

STUDY = """
version = 1
name = "Energy"
scenario = "scene.toml"
merits = ["returns_on_target"]
frames = "0:2"
[[axis]]
field = "lidar.laser.energy_mj"
values = [10.0, 50.0]
"""
REQUIREMENTS = """
version = 1
name = "Hits"
[[requirement]]
id = "R-1"
text = "Some pixel shall report the target."
quantity = "found_fraction"
at_least = 0.0
confidence = 0.95
frames = "0:2"
"""


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    """Return the folder of a scenario whose target turns as an FMU says, with a study, requirements and a dataset."""
    folder = tmp_path_factory.mktemp("trust")
    fmu = compile_reference(folder, "BouncingBall", 2)
    outputs = {"quaternion_xyzw": (0.0, 0.0, 0.6, 0.8), "body_rate_rad_s": (0.0, 0.0, 0.0)}
    attitude = FmuAttitude(file=str(fmu), step_s=0.1, outputs=outputs)
    settings = (
        "time.duration_s=1",
        "lidar.receiver.n_rows=8",
        "lidar.receiver.n_cols=8",
        "lidar.receiver.rays_per_pixel=1",
    )
    base = rl.Scenario.load(Path(__file__).parents[2] / "examples" / "closed_loop.toml", settings=settings)
    scenario = base.replace(target=(base.target[0].replace(attitude=attitude),))
    (folder / "scene.toml").write_text(scenario.with_trusted_fmus().source.scenario)
    (folder / "study.toml").write_text(STUDY)
    (folder / "reqs.toml").write_text(REQUIREMENTS)
    return folder


@pytest.mark.slow
def test_a_trade_flies_fmus_where_they_are_trusted(mission, tmp_path):
    with pytest.raises(ScenarioError, match="holds native code"):
        trade(mission / "study.toml", str(tmp_path / "refused.csv"))
    trade(mission / "study.toml", str(tmp_path / "made.csv"), trust_fmu=True)
    table = (tmp_path / "made.csv").read_text()
    assert table.count("\n") == 3 and "native code" not in table
    untrusted, _ = make_trade_plan(Study.load(mission / "study.toml"), 1)
    assert "holds native code" in untrusted.row(1)["error"]
    plan, _ = make_trade_plan(Study.load(mission / "study.toml"), 1, trust_fmu=True)
    row = pickle.loads(pickle.dumps(plan)).row(1)  # as in a worker process
    assert row["error"] == "" and str(row["merits"]["returns_on_target"]) in table


@pytest.mark.parametrize("subject", ["scene.toml", "study.toml"])
def test_requirements_fly_fmus_where_they_are_trusted(mission, subject, tmp_path):
    reqs = mission / "reqs.toml"
    if subject == "study.toml":
        reqs = tmp_path / "reqs.toml"
        text = REQUIREMENTS.replace("found_fraction", "off_boresight_deg").replace('frames = "0:2"', "")
        reqs.write_text(text.replace("confidence = 0.95", "").replace("at_least = 0.0", "at_most = 180.0"))
    requirements(reqs, mission / subject, [tmp_path / "made.json"], trust_fmu=True)
    assert "holds native code" not in (tmp_path / "made.json").read_text()
    if subject == "scene.toml":
        with pytest.raises(ScenarioError, match="holds native code"):
            requirements(reqs, mission / subject)
        with pytest.raises(ScenarioError, match="--trust-fmu: is for a scenario or a study"):
            requirements(reqs, mission / "recording.h5", trust_fmu=True)
        parameters(mission / "scene.toml", tmp_path / "parameters.csv", trust_fmu=True)
        assert (tmp_path / "parameters.csv").stat().st_size > 1000


def test_a_dataset_flies_fmus_where_they_are_trusted(mission, tmp_path):
    spec = make_spec(tmp_path)
    attitude = (
        f'{{ type = "fmu", file = "{mission / "BouncingBall2.fmu"}", step_s = 0.1, '
        "outputs = { quaternion_xyzw = [0.0, 0.0, 0.0, 1.0], body_rate_rad_s = [0.0, 0.0, 0.0] } }"
    )
    held = SCENARIO.replace("position_m = [0, 0, 0] }", f"position_m = [0, 0, 0] }}, attitude = {attitude}")
    (tmp_path / "bench.toml").write_text(held, encoding="utf-8")
    with pytest.raises(rl.errors.RsoLidarError, match="holds native code"):
        rl.dataset.make(spec, tmp_path / "refused", workers=1)
    made = rl.dataset.make(spec, tmp_path / "made", workers=1, trust_fmu=True)
    assert made.records
    plan = pickle.loads(pickle.dumps(plan_dataset(spec, trust_fmu=True)))  # as a worker process receives it
    assert plan.scenario().bodies[-1].attitude.label == "BouncingBall2.fmu"
