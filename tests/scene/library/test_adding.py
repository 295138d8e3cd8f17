"""A user's own library: what comes in, what is known, guessed and said, and that a scenario flies it."""

import hashlib
import importlib.util
import json
import threading
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

import rso_lidar as rl
from rso_lidar.errors import MeshError, RsoLidarWarning, ScenarioError
from rso_lidar.files import hold_lock
from rso_lidar.scene import (
    MeshOptions,
    add_model,
    load_mesh,
    model,
    models,
    own_folder,
    own_models,
    remove_model,
)
from rso_lidar.scene.library.mesh_units import known_meshes
from rso_lidar.scene.library.model_index import materials_of
from rso_lidar.scene.meshes.cad import tessellate
from tests.scene.meshes.test_mesh import BOX, binary_stl, glb, obj

SOLIDS = (
    Path(__file__).parent / "solids"
)  # a box of 1 x 2 x 3 m with a cylinder of 0.3 m radius and 0.5 m on top, in mm


@pytest.fixture
def box(tmp_path):
    """Write a box of 1 x 2 x 3 units, times a factor, as STL."""

    def write(name="box.stl", factor=1.0, at=(0.0, 0.0, 0.0)):
        path = tmp_path / name
        path.write_bytes(binary_stl(BOX * factor + np.array(at)))
        return path

    return write


def test_a_mesh_is_copied_as_it_stands_and_found_by_name(library, box):
    path = box("My Box-2.stl")
    entry, _ = add_model(path)
    assert entry.name == "my_box-2" and entry.own
    assert entry.path == library / "my_box-2.stl" and entry.path.read_bytes() == path.read_bytes()
    assert entry.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert entry == model("my_box-2") == own_models()["my_box-2"]
    assert "my_box-2" not in models(), "the shipped ones"
    assert sorted(file.name for file in library.iterdir()) == ["index.toml", "my_box-2.stl"], "no drafts left"
    assert np.array_equal(entry.mesh.vertices, load_mesh(path).vertices)


@pytest.mark.parametrize(
    ("wanted", "factor", "size", "says"),
    [
        ({}, 1.0, 3.0, "guessed    unit is metres: 3 m across"),
        ({}, 1000.0, 3.0, "guessed    unit is millimetres"),
        ({}, 100.0, 3.0 * 100, None),  # three hundred of what?
        ({"scale": 0.5}, 1.0, 1.5, None),
        ({"size_m": 12.0}, 77.0, 12.0, None),
    ],
)
def test_units_are_guessed_aloud_and_the_user_decides(library, box, wanted, factor, size, says):
    entry, said = add_model(box(factor=factor), MeshOptions(**wanted))
    if says is None and not wanted:
        assert any("centimetres" in line for line in said), "300 m is no spacecraft"
        return
    assert max(entry.mesh.size_m) == pytest.approx(size, rel=1e-6)  # STL holds 24 bits
    assert entry.size_m == pytest.approx([size / 3, 2 * size / 3, size], abs=1e-4)
    guessed = [line for line in said if "unit" in line]
    assert guessed == [] if says is None else guessed[0].startswith(says)


def test_no_unit_fits(library, box):
    with pytest.raises(MeshError, match=r"is 3e\+09 units across; give --scale or --size-m"):
        add_model(box(factor=1e9))
    assert not library.exists() or not list(library.iterdir()), "nothing half-written"


def test_a_cube_about_the_origin_hints_at_the_scale(library, tmp_path):
    side = 6.0
    cube = (BOX / [1, 2, 3] - BOX.reshape(-1, 3).mean(axis=0) / [1, 2, 3]) * side
    (tmp_path / "rig.stl").write_bytes(binary_stl(np.concatenate([cube, BOX * 30 + 20])))
    _, said = add_model(tmp_path / "rig.stl")
    assert any("helper cube of 1 m, --scale 0.166667" in line for line in said)


def test_y_up_is_turned(library, box):
    assert add_model(box(), MeshOptions(mesh_axes="y_up"))[0].mesh.size_m == pytest.approx([1, 3, 2])


def test_names_that_cannot_be(library, box):
    add_model(box())
    for name, says in (
        ("tdrs", "is a shipped model's"),
        ("box", "is in your library already"),
        ("a/b", "letters"),
        ("a.b", "letters"),
        ("check", "is a command of `rso-lidar models`"),
    ):
        with pytest.raises(MeshError, match=says):
            add_model(box(), MeshOptions(name=name))


def test_overwrite_replaces_and_remove_takes_away(library, box, tmp_path):
    add_model(box())
    (tmp_path / "box.obj").write_bytes(obj([("bus", t) for t in BOX * 2]))
    entry, _ = add_model(tmp_path / "box.obj", overwrite=True)
    assert entry.parts.keys() == {"bus"} and entry.size_m == (2, 4, 6)
    assert not (library / "box.stl").exists(), "the one before"
    assert remove_model("box") == library / "box.obj"
    assert own_models() == {} and [file.name for file in library.iterdir()] == ["index.toml"]
    with pytest.raises(ScenarioError, match=r"model 'box': is not in your library \(yours: none\)"):
        remove_model("box")
    with pytest.raises(ScenarioError, match=r"model 'tdrs': is shipped with the package, and cannot be removed"):
        remove_model("tdrs")


def test_remove_touches_no_file_outside_the_library(library, box):
    path = box()
    add_model(path)
    index = library / "index.toml"
    index.write_text(index.read_text().replace('file = "box.stl"', f'file = "{path}"'))
    remove_model("box")
    assert path.exists()


def test_materials_of_groups_are_guessed_by_name_and_said(library, tmp_path):
    meshes = [("foil_gold.001", BOX), ("Shiny_Panel", BOX + 3), ("tex_01", BOX + 6), ("osr", BOX + 9)]
    (tmp_path / "sat.glb").write_bytes(glb(meshes, [{"mesh": k} for k in range(4)]))
    entry, said = add_model(tmp_path / "sat.glb", MeshOptions(part_materials={"osr": "white_paint"}))
    assert dict(entry.parts) == {
        "foil_gold.001": "mli_gold",
        "Shiny_Panel": "solar_cell",
        "tex_01": "lambertian_30",
        "osr": "white_paint",
    }
    assert any("foil_gold.001 = mli_gold" in line for line in said)
    assert any(line.startswith("assumed    lambertian_30 for tex_01:") for line in said)
    entry, _ = add_model(tmp_path / "sat.glb", MeshOptions(material="aluminium"), overwrite=True)
    assert set(entry.parts.values()) == {"aluminium"}
    for wanted, says in (
        (MeshOptions(material="gold"), "material 'gold': is not in the catalogue"),
        (MeshOptions(part_materials={"bus": "osr"}), "part 'bus': is not in the mesh"),
    ):
        with pytest.raises(MeshError, match=says):
            add_model(tmp_path / "sat.glb", wanted, overwrite=True)


def test_part_classes_are_given_or_those_of_parts_of_that_name(library, tmp_path):
    meshes = [("solar_array_left", BOX), ("antenna", BOX + 3), ("Object.003", BOX + 6), ("wing", BOX + 9)]
    (tmp_path / "sat.glb").write_bytes(glb(meshes, [{"mesh": k} for k in range(4)]))
    entry, said = add_model(tmp_path / "sat.glb", MeshOptions(part_classes={"wing": "solar_array"}))
    classes = {"solar_array_left": "solar_array", "antenna": "antenna", "Object.003": "other", "wing": "solar_array"}
    assert dict(entry.part_classes) == classes == dict(model("sat").part_classes)
    assert any("solar_array_left = solar_array, antenna = antenna" in line for line in said)
    assert any(line.startswith("assumed    part class other for Object.003:") for line in said)
    index = library / "index.toml"
    text = index.read_text()
    index.write_text(text.replace("[model.part_classes]", "[model.unknown]"))  # an index older than part classes
    assert dict(model("sat").part_classes) == classes | {"wing": "other"}
    index.write_text(text)
    for wanted, says in (
        (MeshOptions(part_classes={"wing": "solar_aray"}), "'solar_aray': is unknown; did you mean 'solar_array'"),
        (MeshOptions(part_classes={"wings": "solar_array"}), "part 'wings': is not in the mesh; did you mean 'wing'"),
    ):
        with pytest.raises(MeshError, match=says):
            add_model(tmp_path / "sat.glb", wanted, overwrite=True)
    index.write_text(text.replace('antenna = "antenna"', 'antenna = "dish"'))
    with pytest.raises(MeshError, match=r"part_classes.antenna: unknown value 'dish' \(known: bus"):
        model("sat")


def test_the_user_s_table_of_names_is_asked_first(library):
    library.mkdir()
    table = library / "material_names.toml"
    table.write_text('"foil_gold*" = "mli_silver"\n"tex_*" = "aluminium"\n')
    assert materials_of(["foil_gold_2", "TEX_01", "cfrp", "thing"]) == {
        "foil_gold_2": "mli_silver",
        "TEX_01": "aluminium",
        "cfrp": "cfrp",
    }
    for text, says in (("= 1", "cannot be read"), ('"a*" = "gold"', "'a\\*': unknown material 'gold'")):
        table.write_text(text)
        with pytest.raises(MeshError, match=says):
            materials_of(["a"])


def test_half_of_the_real_groups_that_are_one_material_are_known(shared):
    """Of NASA's groups, those that mix materials (tex, AO, unnamed and numbered ones) have no line on purpose."""
    groups = [
        group["material"]
        for entry in json.loads((shared / "meshes" / "manifest.json").read_text())["models"].values()
        for group in entry.get("materials_glb", {}).get("groups", [])
        if group["material"] not in ("unnamed",) and not any(word in group["material"] for word in ("tex", "AO"))
    ]
    assert len(materials_of(groups)) >= 0.5 * len(set(groups))
    assert "MainBodyBottomLight" not in materials_of(groups), "mli is a word, not three letters"
    assert materials_of(groups).items() >= {"foil_gold": "mli_gold", "shiny_panel": "solar_cell"}.items()


@pytest.mark.parametrize("name", ["dawn", "juno", "lro", "rosetta", "stardust", "suomi_npp", "tdrs"])
def test_nasa_s_printable_files_come_in_as_the_mended_ones(name, shared, library):
    """The data folder holds each file as NASA has it, and in metres without the helper cube, made with other tools."""
    known = next(entry for entry in known_meshes().values() if entry["name"] == f"{name}_nasa")
    original = shared / "meshes" / "nasa_originals" / known["file"]
    entry, said = add_model(original)
    assert entry.name == f"{name}_nasa" and said[0].startswith(f"known      {known['file']}")
    mine, theirs = entry.mesh, load_mesh(shared / "meshes" / f"{name}.stl")
    assert len(mine.facets) == entry.facets == theirs.source_facets
    assert np.abs(mine.vertices[mine.facets] - theirs.vertices[theirs.facets]).max() < 1e-6
    assert entry.path.read_bytes() == original.read_bytes(), "unchanged: the repairs are in the index"
    assert mine.source_facet.max() == mine.source_facets - 1, "labels count as the file does"


def test_a_scenario_flies_a_model_of_the_library_and_its_recording_can_be_flown_again(
    library, tmp_path, text, monkeypatch
):
    plate = load_mesh(model("plate").path)
    path = tmp_path / "target.stl"
    path.write_bytes(binary_stl(1000 * plate.vertices[plate.facets]))
    add_model(path, MeshOptions(scale=1e-3, material="mli_gold"))
    mine = text.replace('model    = "plate"', 'model    = "target"').replace("material =", "#")
    shipped = text.replace("material = { type", 'material = "mli_gold" #')
    frame, same = (next(rl.simulate(rl.Scenario.loads(one), threads=1)) for one in (mine, shipped))
    assert frame.valid.any() and np.array_equal(frame.labels.photons, same.labels.photons)
    source = frame.source
    assert source.targets[0].mesh_sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert source.targets[0].taxonomy.object_class == "payload"
    again = next(rl.simulate(rl.Scenario.loads(source.scenario), threads=1))
    assert np.array_equal(again.range_m, frame.range_m, equal_nan=True)
    monkeypatch.setenv("RSO_LIDAR_MODELS", str(tmp_path / "elsewhere"))
    with pytest.raises(ScenarioError, match=r"unknown model 'target'.*add your own mesh with `rso-lidar models add`"):
        rl.Scenario.loads(source.scenario).surfaces  # noqa: B018 - built when asked for


def test_a_library_that_was_tampered_with_says_so(library, box):
    entry, _ = add_model(box())
    entry.path.write_bytes(binary_stl(BOX * 2))
    with pytest.raises(MeshError, match=r"is not the file that was added as 'box'; add it again"):
        _ = model("box").mesh
    index = library / "index.toml"
    sound = index.read_text()
    for old, new in (
        ("scale = 1.0", 'scale = "a"'),
        ("scale = 1.0", "scale = -1.0"),
        ("left_out = []", "left_out = [3]"),
        ('mesh_axes = "z_up"', 'mesh_axes = "x_up"'),
        ("[model.parts]", "[model.part]"),
        ("[[model]]", "[[model]"),
        ("[[model]]", "model = 3\n[[models]]"),
        ('object_class = "payload"', 'object_class = "satellite"'),
        ('what = "a mesh of your own"', "size_m = 3\n"),
    ):
        assert old in sound
        index.write_text(sound.replace(old, new))
        with pytest.raises((MeshError, ScenarioError)) as caught:
            model("box")
        assert "\n" not in str(caught.value) and "index.toml" in str(caught.value)


def test_a_broken_entry_is_left_out_and_can_be_taken_out(library, box):
    add_model(box())
    add_model(box(), MeshOptions(name="other"))
    index = library / "index.toml"
    index.write_text(index.read_text().replace("scale = 1.0", 'scale = "a"', 1))
    with pytest.warns(RsoLidarWarning, match=r"model 'box': scale: should be a valid number"):
        assert set(own_models()) == {"other"}
    assert model("other").scale == 1.0
    remove_model("box")
    assert set(own_models()) == {"other"} and not (library / "box.stl").exists()


@pytest.mark.parametrize("scale", [1e300, 1e9, 1e-9])
def test_a_size_that_nothing_has_is_refused_before_anything_is_written(library, box, scale):
    with pytest.raises(MeshError, match=r"m across; give --scale or --size-m"):
        add_model(box(), MeshOptions(scale=scale))
    assert not list(library.glob("*.stl")) and own_models() == {}


def test_what_an_index_leaves_out_is_told_before_a_run(library, tmp_path, text):
    path = tmp_path / "two.stl"
    path.write_bytes(binary_stl(np.concatenate([BOX, BOX * 0.5 + 9, np.zeros((1, 3, 3))])))
    add_model(path)
    index = library / "index.toml"
    index.write_text(index.read_text().replace("left_out = []", "left_out = [[12, 23]]"))
    mesh = model("two").mesh
    assert (len(mesh.facets), mesh.left_out, mesh.degenerate, mesh.source_facets) == (12, 12, 1, 25)
    said = rl.Scenario.loads(text.replace('model    = "plate"', 'model    = "two"')).describe()
    assert "1 degenerate dropped, 12 left out" in said
    index.write_text(index.read_text().replace("[[12, 23]]", "[[0, 24]]"))
    with pytest.raises(MeshError, match=r"all its facets are left out"):
        _ = model("two").mesh


def test_a_shipped_name_wins_and_says_so(library, box):
    add_model(box())
    index = library / "index.toml"
    index.write_text(index.read_text().replace('name = "box"', 'name = "plate"'))
    with pytest.warns(RsoLidarWarning, match=r"model 'plate': is shipped, and also in your library"):
        assert not model("plate").own
    assert not model("plate").own, "said once: a second warning would be an error here"


def test_a_broken_index_stops_what_is_flown_of_it_and_nothing_else(library, box, text):
    add_model(box())
    (library / "index.toml").write_text("[[model]")
    assert next(rl.simulate(rl.Scenario.loads(text), threads=1)).valid.any(), "a shipped model"
    with pytest.raises(MeshError, match=r"index\.toml: cannot be read"):
        model("box")


def test_who_adds_waits_for_who_is_adding(library, box):
    """Without the lock the name would be free, and the index read before, and lost with, what the other writes."""
    add_model(box("first.stl"))
    failed, second, same = [], box("second.stl"), box("other.stl")

    def add(*given):
        try:
            add_model(*given)
        except MeshError as error:
            failed.append(str(error))

    with hold_lock(library / ".index.lock"):
        index = library / "index.toml"
        waiting = [
            threading.Thread(target=add, args=(second,)),
            threading.Thread(target=add, args=(same, MeshOptions(name="third"))),
            threading.Thread(target=remove_model, args=("first",)),
        ]
        for thread in waiting:
            thread.start()
        time.sleep(0.3)
        assert all(thread.is_alive() for thread in waiting) and list(own_models()) == ["first"]
        (library / "third.stl").write_bytes((library / "first.stl").read_bytes())
        sound = index.read_text()
        entry = sound[sound.index("[[model]]") :].replace('"first', '"third')
        index.write_text(f"{sound}\n{entry}")
    for thread in waiting:
        thread.join()
    assert sorted(own_models()) == ["second", "third"]
    assert len(failed) == 1 and failed[0].startswith("name 'third': is in your library already")
    assert sorted(file.name for file in library.iterdir()) == ["index.toml", "second.stl", "third.stl"]


def test_the_library_lies_where_the_platform_keeps_data(monkeypatch, tmp_path):
    import platformdirs

    monkeypatch.delenv("RSO_LIDAR_MODELS")
    assert own_folder() == platformdirs.user_data_path("rso_lidar", appauthor=False) / "models"
    monkeypatch.setenv("RSO_LIDAR_MODELS", "~/meshes")
    assert own_folder() == Path.home() / "meshes"


def test_a_library_that_cannot_be_made(box, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("RSO_LIDAR_MODELS", str(tmp_path / "file" / "library"))
    with pytest.raises(MeshError, match=r"cannot be made .*RSO_LIDAR_MODELS"):
        add_model(box())


def test_messages_name_the_user_s_file_and_all_parts_that_are_assumed(library, tmp_path):
    groups = [(f"part_{k}", triangle) for k, triangle in enumerate(BOX)]
    path = tmp_path / "craft.obj"
    path.write_bytes(obj(groups))
    _, report = add_model(path)
    assumed = next(line for line in report if "lambertian_30" in line)
    assert all(f"part_{k}" in assumed for k in range(12)) and "more" not in assumed
    path.write_bytes(obj([(name, 1e-9 * triangle) for name, triangle in groups]))
    with pytest.raises(MeshError, match=r"^craft\.obj: is ") as refused:
        add_model(path, MeshOptions(name="other", scale=1.0))
    assert "part." not in str(refused.value)


def test_a_gltf_with_data_beside_it_is_not_torn_apart(library, tmp_path):
    blob = glb([("bus", BOX)], [{"mesh": 0}])
    length = int.from_bytes(blob[12:16], "little")
    tree, buffer = json.loads(blob[20 : 20 + length]), blob[28 + length :]
    (tmp_path / "a.bin").write_bytes(buffer)
    (tmp_path / "a.gltf").write_text(json.dumps({**tree, "buffers": [{"byteLength": len(buffer), "uri": "a.bin"}]}))
    assert len(load_mesh(tmp_path / "a.gltf").facets) == 12
    with pytest.raises(MeshError, match=r"keeps its data in other files; export it as one \.glb"):
        add_model(tmp_path / "a.gltf")


@pytest.mark.parametrize("name", ["part.step", "part.igs"])
def test_solids_come_in_through_the_extra(name, library):
    assert (SOLIDS / name).is_file()  # without the extra too
    if importlib.util.find_spec("cascadio") is None:
        pytest.skip("needs the extra step: pip install 'rso-lidar[step]'")
    entry, said = add_model(SOLIDS / name)
    assert any(line.startswith("unit       as the file states: 3.5 m") for line in said)
    assert entry.size_m == (1.0, 2.0, 3.5) and entry.path.suffix == ".glb"
    mesh = entry.mesh
    corners = mesh.vertices[mesh.facets]
    top = corners[(corners[..., 2] > 3.4).all(axis=1)].reshape(-1, 3)
    radius = np.linalg.norm(top[:, :2] - [0.5, 1.0], axis=1)
    assert radius.max() == pytest.approx(0.3, abs=1e-5), "corners lie on the cylinder; float32 millimetres"
    assert tomllib.loads((library / "index.toml").read_text())["model"][0]["source"].startswith("tessellate to 1 mm")


def test_solids_that_are_none(tmp_path, monkeypatch):
    bad = tmp_path / "bad.step"
    bad.write_bytes(b"ISO-10303-21;")
    if importlib.util.find_spec("cascadio") is not None:
        with pytest.raises(
            MeshError, match=r"bad\.step: cannot be read as STEP, or contains no solid; export it again"
        ):
            tessellate(bad)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        MeshError, match=r"STEP and IGES need the extra 'step' \(pip install 'rso-lidar\[step\]'\); or export"
    ):
        tessellate(bad)
