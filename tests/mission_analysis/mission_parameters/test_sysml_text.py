"""The SysML v2 text: read by the OpenMBEE SysML Toolkit against the OMG's libraries, which knows nothing of this package."""

import re
from pathlib import Path

import pytest

import rso_lidar as rl
from rso_lidar.errors import ScenarioError
from rso_lidar.mission_analysis import MissionParameter, list_parameters, quote_name
from rso_lidar.mission_analysis.mission_parameters.sysml_text import write_model
from rso_lidar.mission_analysis.mission_parameters.sysml_units import UNITS, declare_units
from rso_lidar.study import Requirements, write_requirements

REQUIREMENTS = "examples/requirements/tdrs_inspection.toml"


def read(text, tmp_path):
    """Read a text with the toolkit, and return the model; a text that does not parse is an error."""
    sysml = pytest.importorskip(
        "sysml", reason="the package sysml, an independent reader of SysML v2, is not installed"
    )
    path = tmp_path / "model.sysml"
    path.write_text(text, encoding="utf-8")
    return sysml.Model.from_toolkit(str(path), library_dir=sysml.standard_library())


def typings(model):
    """Return the qualified name of the type of each attribute, by its name; an unresolved type is an error."""
    return {
        attribute.qualifiedName: typing.type.qualifiedName
        for attribute in model.elements_of_type("AttributeUsage")
        for typing in attribute.ownedTyping
    }


def test_every_attribute_has_a_type_of_the_libraries(tmp_path):
    parameters = list_parameters(rl.Scenario.load("examples/tdrs_approach.toml"))
    asked = Requirements.load(REQUIREMENTS)
    model = read(parameters.sysml_text(write_requirements(asked, parameters)), tmp_path)
    found = typings(model)
    start = "'TDRS hop, 3 km to 300 m'::mission::"
    assert found[f"{start}lidar::laser::wavelength_nm"] == "ISQBase::LengthValue"
    assert found[f"{start}lidar::laser::energy_mj"] == "ISQThermodynamics::EnergyValue"
    assert found[f"{start}lidar::receiver::ifov_rad"] == "ISQSpaceTime::AngularMeasureValue"
    assert found[f"{start}lidar::laser::photons"] == "ScalarValues::Real"
    given = [one for one in parameters.parameters if one.value not in (None, (), {})]
    assert sum(name.startswith(start) for name in found) == len(given)
    short = [one.declaredShortName for one in model.elements_of_type("RequirementUsage")]
    assert [name for name in short if name] == [one.id for one in asked.requirement]
    assert len(list(model.elements_of_type("VerificationCaseUsage"))) == len(asked.requirement)


KINDS = [
    "thrusters",
    "geiger_bench",
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("proximity_1570", "lunar_descent", "ghosts_and_glare")),
]


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_of_scenario_is_read(name, tmp_path):
    found = typings(
        read(list_parameters(rl.Scenario.load(f"examples/{name}.toml", trust_code=True)).sysml_text(), tmp_path)
    )
    assert len(found) > 80


def test_names_and_texts_are_quoted(tmp_path):
    values = [
        MissionParameter("state.first", 1.5, "m", "A reserved word; it ends */ here.", None, "scenario"),
        MissionParameter("a-b.c'd", 'say "no" \\ yes', "", "Odd.", None, "scenario"),
        MissionParameter("table", ((1.0, 2.0), (3.0, 4.0)), "deg", "Rows.", None, "scenario"),
        MissionParameter("flags", (True, False), "", "Truth.", None, "scenario"),
        MissionParameter("none", None, "m", "Not there.", None, "default"),
    ]
    text = write_model("it's", values, "about")
    assert (
        "attribute table : AngularMeasureValue[4] ordered nonunique = (1.0 ['°'], 2.0 ['°'], 3.0 ['°'], 4.0 ['°'])"
        in text
    )
    found = typings(read(text, tmp_path))
    kinds = [one.rpartition("::")[2] for one in found.values()]
    assert kinds == ["AngularMeasureValue", "Boolean", "LengthValue", "String"]  # attributes stand before parts
    assert quote_name("in") == "'in'" and quote_name("9m") == "'9m'" and quote_name("a_1") == "a_1"


def test_units_of_inertial_sensors_are_declared_with_their_factors(tmp_path):
    values = [
        MissionParameter(f"imu.{name}", 2.5, unit, "Noise.", None, "scenario")
        for name, unit in (("bias", "µg/√h"), ("walk", "deg/√h"), ("scale", "ppm"), ("most", "g"), ("speed", "rpm"))
    ]
    text = write_model("units", values, "about")
    assert "attribute bias : ScalarQuantityValue = 2.5 ['µgn'/h^0.5] {" in text
    assert ":>> referenceUnit = m/s^2; :>> conversionFactor = 9.80665;" in text  # of gn, of which µgn is the millionth
    assert text.index("attribute <gn>") < text.index("attribute <'µgn'>")
    kinds = {name.rpartition("::")[2]: kind.rpartition("::")[2] for name, kind in typings(read(text, tmp_path)).items()}
    assert kinds["most"] == "AccelerationValue" and kinds["scale"] == "DimensionOneValue"


def test_units_are_those_of_the_library_or_declared():
    sysml = pytest.importorskip("sysml", reason="needs OpenMBEE's reader: pip install sysml")
    folder = Path(sysml.standard_library()) / "Domain Libraries" / "Quantities and Units"
    known = set(re.findall(r"attribute <('?[^>']+'?)>", (folder / "SI.sysml").read_text(encoding="utf-8")))
    assert {"m", "nm", "'°'", "'Ω'"} <= known
    for notation in UNITS.values():
        words = set(re.findall(r"'[^']+'|[A-Za-z]+", notation.unit))
        declared = {line.partition("<")[2].partition(">")[0] for line in declare_units({notation.unit})}
        assert words <= known | declared, notation
        assert not declared & known


def test_a_requirement_on_what_is_not_there_is_refused():
    parameters = list_parameters(rl.Scenario.load("examples/tdrs_approach.toml"))
    asked = Requirements.loads(
        'version = 1\nname = "n"\n[[requirement]]\nid = "A"\ntext = "t"\nquantity = "lidar.lase.x"\nat_most = 1'
    )
    with pytest.raises(ScenarioError, match="no such parameter"):
        write_requirements(asked, parameters)
