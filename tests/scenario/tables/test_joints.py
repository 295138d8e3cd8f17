"""Hinges that a model declares, and materials and taxonomy by name."""

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.export.layout.target_table import read_targets, tabulate_targets
from rso_lidar.records import TargetEntry
from rso_lidar.scenario import find_taxonomy
from rso_lidar.scene import model

FIXED = rl.Fixed(position_m=(0.0, 0.0, 0.0))
NORTH = {"name": "solar_north", "angle": rl.motion.FollowSun()}


def tdrs(**fields):
    return rl.Target(name="tdrs", model="tdrs", motion=FIXED, **fields)


def test_a_joint_takes_from_the_model_what_it_leaves_out():
    (joint,) = tdrs(joint=(rl.Joint(**NORTH),)).joints
    hinge = next(one for one in model("tdrs").hinges if one.name == "solar_north")
    assert joint.parts == hinge.parts
    assert joint.axis == hinge.axis
    assert joint.angle.normal == hinge.normal
    assert joint.position_m == pytest.approx(np.subtract(hinge.position_m, model("tdrs").center_of_mass_m), abs=1e-12)


def test_what_is_given_wins():
    (joint,) = tdrs(joint=(rl.Joint(**NORTH, axis=(0.0, 1.0, 0.0), position_m=(1.0, 2.0, 3.0)),)).joints
    assert joint.axis == (0.0, 1.0, 0.0)
    assert joint.position_m == (1.0, 2.0, 3.0)
    assert "solar_yoke_north" in joint.parts


def test_a_hinge_goes_with_scale_and_axes():
    """A model half as large, its y up: x, y, z of the file become x, -z, y of the body."""
    hinge = next(one for one in model("tdrs").hinges if one.name == "solar_north")
    center = np.array(model("tdrs").center_of_mass_m)
    (joint,) = tdrs(scale=0.5, mesh_axes="y_up", joint=(rl.Joint(**NORTH),)).joints
    x, y, z = 0.5 * (np.array(hinge.position_m) - center)
    assert joint.position_m == pytest.approx([x, -z, y], abs=1e-12)
    assert joint.angle.normal == pytest.approx([0.0, -1.0, 0.0])


@pytest.mark.parametrize(
    ("joint", "told"),
    [
        (
            {"name": "solar_nort", "angle": rl.motion.FollowSun()},
            r"joint solar_nort: parts and axis missing.*tdrs has solar_north, solar_south",
        ),
        ({"name": "a", "parts": ("bus",), "angle": rl.motion.FixedAngle()}, r"joint a: axis missing"),
        (
            {"name": "a", "parts": ("bus",), "axis": (1.0, 0.0, 0.0), "angle": rl.motion.FollowSun()},
            r"joint a: .*angle\.normal: is missing; give the direction",
        ),
    ],
)
def test_what_is_missing_is_one_line(joint, told):
    with pytest.raises(rl.ScenarioError, match=told) as caught:
        tdrs(joint=(rl.Joint(**joint),))
    assert "\n" not in str(caught.value)


def test_materials_by_name_are_those_of_the_catalogue_at_the_laser_s_wavelength():
    assert tdrs(material="white_paint").material == rl.scene.Named(name="white_paint")
    paint = rl.scene.Named(name="white_paint")
    assert paint.at(1064e-9) == rl.Phong(diffuse=0.80, specular=0.02, exponent=10.0)
    assert paint.at(1570e-9) == rl.Phong(diffuse=0.70, specular=0.02, exponent=10.0)
    with pytest.raises(rl.ScenarioError, match=r"unknown material 'whit_paint'; did you mean 'white_paint'\?"):
        tdrs(part_materials={"bus": "whit_paint"})


def test_taxonomy_is_the_catalogue_s_unless_given_and_survives_a_table():
    assert find_taxonomy(tdrs()) == model("tdrs").taxonomy
    own = model("tdrs").taxonomy.replace(stabilisation="tumbling", rate_deg_s=(1.0, 2.0))
    assert find_taxonomy(tdrs(taxonomy=own)) == own
    entry = TargetEntry("tdrs", "tdrs", "0" * 64, ("bus",), ("lambertian",), 12, own)
    assert read_targets(tabulate_targets([entry])) == (entry,)
    older = [{key: value for key, value in table.items() if key != "taxonomy"} for table in tabulate_targets([entry])]
    assert read_targets(older)[0].taxonomy is None
    assert rl.Taxonomy(**{**own.model_dump(), "rate_deg_s": (0.0, 0.0)}).in_words.endswith("large, tumbling")


def test_corners_of_a_target_are_those_of_its_mesh_whatever_turns(text):
    """Surfaces of hinges have their own origins; put back and unturned they are the mesh again."""
    plain = rl.Scenario.loads(text, settings=('target.plate.model="tdrs"',))
    joint = '[{name="solar_north", angle={type="fixed", angle_deg=40}}]'
    hinged = rl.Scenario.loads(text, settings=('target.plate.model="tdrs"', f"target.plate.joint={joint}"))
    assert len(hinged.surfaces_of(0)) == 2
    whole, parts = (one.corners_of(0).reshape(-1, 9) for one in (plain, hinged))
    for found, expected in ((parts.min(axis=0), whole.min(axis=0)), (parts.max(axis=0), whole.max(axis=0))):
        assert found == pytest.approx(expected, abs=1e-9)  # rounding
    assert parts.sum(axis=0) == pytest.approx(whole.sum(axis=0), abs=1e-6)
