"""An instrument says the same after it was written out, and a plan never leaves what it was given."""

import tomllib

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

import rso_lidar as rl
from rso_lidar.scenario import Schedule, load_presets

GATED = {"type": "gsfl", "gate": {"delay_ns": 100.0}}
LISTS = {
    "focal_length_mm": (1.0, 1e4),
    "divergence_deg": (1e-3, 179.0),
    "energy_mj": (1e-6, 1e6),
    "gate_delay_ns": (0.0, 1e9),
}


@st.composite
def plans(draw):
    time_s = sorted(draw(st.sets(st.floats(-1e6, 1e6, allow_subnormal=False), min_size=1, max_size=6)))
    names = draw(st.sets(st.sampled_from(sorted(LISTS)), min_size=1))
    values = {
        name: draw(st.lists(st.floats(*LISTS[name]), min_size=len(time_s), max_size=len(time_s)))
        for name in sorted(names)
    }
    return Schedule(time_s=time_s, interpolation=draw(st.sampled_from(["linear", "step"])), **values)


@given(plan=plans(), time_s=st.floats(-2e6, 2e6))
def test_a_plan_stays_between_its_values_and_meets_them(plan, time_s):
    for name, value in plan.at(time_s).items():
        values = getattr(plan, name)
        rounding = 1e-15 * max(values)  # of the interpolation's greatest term
        assert min(values) - rounding <= value <= max(values) + rounding
        assert plan.at(plan.time_s[0] - 1.0)[name] == values[0]
        assert plan.at(plan.time_s[-1] + 1.0)[name] == values[-1]
        for knot_s, wanted in zip(plan.time_s, values, strict=True):
            assert plan.at(knot_s)[name] == wanted


@settings(max_examples=40)
@given(
    plan=plans(),
    name=st.sampled_from(sorted(load_presets())),
    energy_mj=st.floats(1e-3, 1e3),
    fov_deg=st.floats(0.1, 100),
)
def test_an_instrument_written_out_is_the_same(plan, name, energy_mj, fov_deg):
    lidar = rl.Lidar(
        preset=name, laser={"energy_mj": energy_mj}, receiver={"fov_deg": fov_deg}, detector=GATED, schedule=plan
    )
    assert (lidar.laser.energy_mj, lidar.receiver.fov_deg, lidar.receiver.focal_length_mm) == (energy_mj, fov_deg, None)
    text = tomli_w.dumps(lidar.model_dump(exclude_none=True))
    assert rl.Lidar(**tomllib.loads(text)) == lidar


@given(
    plan=plans(),
    energy_j=st.none() | st.floats(1e-9, 1e3),
    focal_length_m=st.none() | st.floats(1e-3, 10.0),
    gate_delay_s=st.none() | st.floats(0.0, 1.0),
)
def test_what_is_in_force_is_the_command_or_the_plan(plan, energy_j, focal_length_m, gate_delay_s):
    lidar = rl.Lidar(preset="gsfl_1064", detector=GATED, schedule=plan)
    command = rl.Command(energy_j=energy_j, focal_length_m=focal_length_m, gate_delay_s=gate_delay_s)
    found, planned = lidar.at(0.0, command).settings, lidar.at(0.0).settings
    for name, value in (
        ("laser_energy_j", energy_j),
        ("focal_length_m", focal_length_m),
        ("gate_delay_s", gate_delay_s),
    ):
        assert found[name] == (planned[name] if value is None else pytest.approx(value, rel=1e-12, abs=1e-300))
