"""The catalogue reader: what is there, and one line when it is not."""

import tomllib

import pytest
import tomli_w
from pydantic import ValidationError

from rso_lidar.errors import MeshError, ScenarioError
from rso_lidar.scene import ModelEntry, load_materials, model, models
from rso_lidar.scene.library.model_index import read_materials, read_models


def test_catalogue_lists_models_with_files_and_materials():
    assert {"tdrs", "juno", "cubesat_3u", "rocket_body", "plate"} <= set(models())
    for name, entry in models().items():
        assert entry.name == name
        assert entry.path.is_file()
        assert entry.path.stat().st_size == entry.size_bytes
        assert set(entry.parts.values()) <= set(load_materials())
        assert len(entry.inertia_kg_m2) == len(entry.inertia_kg_m2[0]) == len(entry.size_m) == 3
        assert model(name) is entry


def test_what_is_handed_out_cannot_spoil_the_catalogue():
    models().clear()
    load_materials()["mli_gold"]["diffuse"] = 2.0
    assert models()
    assert load_materials()["mli_gold"]["diffuse"] <= 1.0
    with pytest.raises(ValidationError, match="frozen"):
        model("tdrs").mass_kg = 0.0
    with pytest.raises(TypeError):
        model("tdrs").parts["bus"] = "osr"


def test_unknown_model_is_one_line_with_a_cure():
    with pytest.raises(
        ScenarioError, match=r"^unknown model 'tdsr'; did you mean 'tdrs'\? \(known: .*juno.*\); add your own mesh .*$"
    ):
        model("tdsr")


def test_missing_index_is_one_line(tmp_path):
    with pytest.raises(MeshError, match=r"index\.toml: cannot be read \(no such file.*\); install .*") as caught:
        read_models(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"[[model]\n", b"\xff\xfe", b"name = "])
def test_corrupt_index_is_one_line(tmp_path, content):
    for name, read in (("index.toml", read_models), ("materials.toml", read_materials)):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(MeshError, match=rf"{name}: cannot be read") as caught:
            read(tmp_path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", ["", "model = 3\n"])
def test_empty_index_is_an_error(tmp_path, content):
    (tmp_path / "index.toml").write_text(content)
    with pytest.raises(MeshError, match=r"lists no \[\[model\]\]"):
        read_models(tmp_path)


def test_entry_that_lacks_keys_names_them(tmp_path):
    entry = {name: "?" for name in ModelEntry.model_fields if name not in ("path", "sha256", "axes")}
    (tmp_path / "index.toml").write_text(tomli_w.dumps({"model": [entry | {"name": "probe"}]}))
    with pytest.raises(MeshError, match=r"model 'probe': lacks axes, sha256; install the package again"):
        read_models(tmp_path)


def test_entry_of_the_wrong_kind_is_an_error(tmp_path):
    (tmp_path / "index.toml").write_text("model = [1]\n")
    with pytest.raises(MeshError, match=r"model '\?': lacks name, file"):
        read_models(tmp_path)


def test_material_without_a_type_is_an_error(tmp_path):
    (tmp_path / "materials.toml").write_text("[foil]\ndiffuse = 0.1\n")
    with pytest.raises(MeshError, match=r"materials\.toml: foil: has no 'type'"):
        read_materials(tmp_path)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("size_m", "x"),
        ("size_m", [1]),
        ("size_m", [10**400, 1, 1]),
        ("center_of_mass_m", [float("nan"), 0.0, 0.0]),
        ("center_of_mass_m", []),
        ("parts", "x"),
        ("parts", {"bus": 3}),
        ("name", []),
        ("name", 5),
        ("what", 5),
        ("facets", "many"),
        ("mass_kg", "x"),
        ("mass_kg", -1.0),
        ("inertia_kg_m2", [["a"]]),
        ("scale", True),
        ("scale", 1e300),
        ("mesh_axes", "x_up"),
        ("left_out", [[5, 1]]),
        ("left_out", [[1.5, 2.5]]),
        ("taxonomy", {"object_class": "moon"}),
        ("hinge", [{"name": "a"}]),
        ("sha256", "none"),
    ],
)
def test_a_value_that_is_none_is_one_line(tmp_path, key, value):
    shipped = tomllib.loads((model("plate").path.parent / "index.toml").read_text())["model"]
    entry = {**next(one for one in shipped if one["name"] == "tdrs"), key: value}
    (tmp_path / "index.toml").write_text(tomli_w.dumps({"model": [entry]}))
    with pytest.raises(MeshError, match=rf"index\.toml: model '.*': .*{key}") as caught:
        read_models(tmp_path)
    assert "\n" not in str(caught.value)
