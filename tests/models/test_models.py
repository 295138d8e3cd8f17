"""The craft that travel with the package: closed, of the published size, and as the builders make them."""

import ast
import hashlib

import numpy as np
import pytest
import trimesh

from models.build.build import build, builders
from models.build.materials import MATERIALS
from models.build.measured import MEASUREMENTS, SOLAR, preset_reflectance
from models.build.spectra import SPECTRA
from models.build.write import write
from rso_lidar.errors import ScenarioError
from rso_lidar.records import PART_CLASSES, classify_size
from rso_lidar.scene import find_material, load_materials, models, total_reflectance
from rso_lidar.shapes import Solid, glb
from rso_lidar.shapes.model import _PARTS as PART_TABLE
from tests.house.sources import parse

NAMES = sorted(builders())
CRAFT = [name for name in NAMES if name not in ("plate", "sphere") and not name.startswith("debris_")]


@pytest.fixture(scope="module")
def built():
    return {name: build(name) for name in NAMES}


@pytest.fixture(scope="module")
def loaded():
    return {name: trimesh.load_scene(models()[name].path, process=False) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_every_part_is_closed_and_every_shell_faces_outward(built, name):
    for part, solid in built[name].parts.items():
        mesh = trimesh.Trimesh(*solid, process=False)
        assert mesh.is_watertight, part
        assert mesh.is_winding_consistent, part
        assert mesh.area_faces.min() > 0.0, part
        label = trimesh.graph.connected_component_labels(mesh.face_adjacency, node_count=len(mesh.faces))
        a, b, c = (mesh.triangles[:, k] for k in range(3))
        volumes = np.bincount(
            label, np.einsum("ij,ij->i", a - mesh.centroid, np.cross(b - mesh.centroid, c - mesh.centroid))
        )
        assert volumes.min() > 0.0, f"{part}: a shell is inside out"


@pytest.mark.parametrize("name", CRAFT)
def test_craft_has_fine_structure_in_a_small_file(built, name):
    assert 2_000 <= built[name].facet_count <= 30_000
    assert models()[name].size_bytes < 800_000
    assert len(built[name].parts) >= (8 if name == "cubesat_1u" else 10)


@pytest.mark.parametrize("name", NAMES)
def test_part_names_are_plain(built, name):
    assert all(part.replace("_", "").replace("-", "").isalnum() and part.isascii() for part in built[name].parts)


def test_tdrs_has_the_span_that_boeing_published(built):
    # 68 ft 10 in by 43 ft 5 in, given to the inch: half an inch is 13 mm
    assert built["tdrs"].size_m[:2] == pytest.approx([(68 + 10 / 12) * 0.3048, (43 + 5 / 12) * 0.3048], abs=0.013)
    for side in ("east", "west"):
        across = np.ptp(built["tdrs"].parts[f"antenna_single_access_{side}"].vertices, axis=0)
        assert across[:2] == pytest.approx(15 * 0.3048, abs=0.02)  # 15 ft; a rim of 64 sides is up to 3 mm short


def test_juno_has_the_published_span_width_and_antenna(built):
    parts = built["juno"].parts
    for wing in ("left", "right"):
        radius = np.hypot(*parts[f"solar_substrate_{wing}"].vertices[:, :2].T)
        assert 2 * radius.max() == pytest.approx(20.1, abs=0.05)  # 20.1 m, given to 0.1 m
    board = parts["solar_substrate_x"].vertices
    assert np.ptp(board[:, 1]) == pytest.approx(2.65, abs=0.005)
    # 8.9 m is published for a wing; beside a 3.5 m bus it does not fit into 20.1 m, which leaves 8.4 m (6 % less)
    wing = np.hypot(*parts["solar_array_left"].vertices[:, :2].T)
    assert 0.93 * 8.9 < wing.max() - wing.min() < 8.9
    assert np.ptp(parts["antenna_high_gain"].vertices[:, 0]) == pytest.approx(2.5, abs=0.005)
    assert np.ptp(parts["bus"].vertices[:, 1]) == pytest.approx(3.5, abs=0.05)
    assert 3.5 < built["juno"].size_m[2] < 4.6  # 3.5 m the body, 4.6 m over all


def test_juno_wings_stand_at_120_degrees(built):
    centers = [
        built["juno"].parts[f"solar_array_{wing}"].vertices[:, :2].mean(axis=0) for wing in ("x", "left", "right")
    ]
    angles = [np.arctan2(y, x) for x, y in centers]
    assert np.diff(np.unwrap(angles)) == pytest.approx(2 * np.pi / 3, abs=1e-9)


def test_cubesat_rails_are_the_standard_s(built):
    rails = np.ptp(built["cubesat_3u"].parts["rails"].vertices, axis=0)
    assert rails == pytest.approx([0.3405, 0.1000, 0.1000], abs=1e-9)  # drawn, not made: the standard allows 0.1 mm
    body = np.abs(built["cubesat_3u"].parts["bus"].vertices[:, 1:]).max()
    assert body <= 0.050 + 0.0065  # nothing of the body stands out of the rails by more than the standard's 6.5 mm
    assert built["cubesat_3u"].mass_kg <= 6.0


def test_rocket_body_is_as_long_and_as_wide_as_a_centaur(built):
    parts = built["rocket_body"].parts
    stage = np.concatenate([solid.vertices for name, solid in parts.items() if "adapter" not in name])
    assert np.ptp(stage[:, 0]) == pytest.approx(12.68, abs=0.01)
    assert 2 * np.hypot(*parts["tank"].vertices[:, 1:].T).max() == pytest.approx(3.05, abs=0.03)  # a raised band: 12 mm
    nozzle = parts["nozzle"].vertices
    inner = np.hypot(*nozzle[:, 1:].T)
    throat, exit_plane = inner.min(), inner[np.isclose(nozzle[:, 0], nozzle[:, 0].min(), atol=0.02)].min()
    assert (exit_plane / throat) ** 2 == pytest.approx(84.0, rel=0.01)
    assert built["rocket_body"].mass_kg == pytest.approx(2247.0, rel=0.01)


def test_plate_and_sphere_are_what_they_say(built):
    assert built["plate"].size_m == pytest.approx([0.002, 4.0, 4.0])
    assert np.linalg.norm(built["sphere"].parts["sphere"].vertices, axis=1) == pytest.approx(1.0, abs=1e-14)


def test_lro_has_the_published_cameras_and_mass(built):
    cameras = built["lro"].parts["camera_narrow_angle"].vertices
    front = cameras[cameras[:, 1] < cameras[:, 1].min() + 0.001]
    assert np.ptp(front[:, 0]) == pytest.approx(0.26 + 0.07, abs=0.005)  # 26 cm, and 7 cm from one to the other
    assert cameras[:, 1].min() == pytest.approx(0.22 - 0.70, abs=0.005)  # 70 cm long; "10 inches, 27.5 inches"
    wide = np.ptp(built["lro"].parts["camera_wide_angle"].vertices, axis=0)
    assert sorted(wide) == pytest.approx([0.158, 0.232, 0.323], abs=1e-9)
    assert built["lro"].mass_kg == pytest.approx(1018.0, rel=0.01)  # dry
    # launched 3.9 m tall, 2.7 m by 2.6 m: the bus is within that, and with its rod nearly as tall
    assert np.all(np.ptp(built["lro"].parts["bus"].vertices, axis=0) < [2.7, 2.6, 3.9])
    assert 3.5 < built["lro"].size_m[2] < 3.9


def test_lro_cells_keep_off_the_cut_corners(built):
    cells, board = built["lro"].parts["solar_array"].vertices, built["lro"].parts["solar_substrate"].vertices
    for side in (-1, 1):
        reach = [(points[:, 0] + side * points[:, 1]).max() for points in (cells, board)]
        assert 0.0 < reach[1] - reach[0] < 0.35  # a cell is 0.2 m on its sides


def test_suomi_npp_has_the_published_bus_and_instruments(built):
    parts = built["suomi_npp"].parts
    assert built["suomi_npp"].size_m[2] == pytest.approx(4.2, abs=0.05)  # 1.3 m by 1.3 m by 4.2 m, given to 0.1 m
    low = parts["bus"].vertices[parts["bus"].vertices[:, 2] < -1.5]
    assert np.ptp(low, axis=0)[:2] == pytest.approx([1.3, 1.3], abs=0.05)
    panels = trimesh.Trimesh(*parts["solar_substrate"], process=False).split()
    assert sum(np.prod(panel.extents[:2]) > 1.0 for panel in panels) == 3
    upright = {name: Solid(*parts[name]).turn("y", -15.0).vertices for name in ("cris", "ceres")}
    foot = Solid(*parts["bus"]).turn("y", -15.0).vertices[:, 0].min()
    assert foot - upright["cris"][:, 0].min() == pytest.approx(0.70, abs=0.05)  # 70 cm by 45 cm by 47 cm
    assert np.ptp(upright["cris"][:, 2]) == pytest.approx(0.47, abs=0.005)
    assert foot - upright["ceres"][:, 0].min() == pytest.approx(0.70, abs=0.05)  # 60 cm by 60 cm by 70 cm


@pytest.mark.parametrize("name", ["tdrs", "juno", "lro", "suomi_npp"])
def test_craft_has_the_outline_of_nasa_s_model(built, name, shared):
    """NASA's public model of the craft, in the same axes: extents agree within a tenth of the largest."""
    theirs = trimesh.load_mesh(shared / "meshes" / f"{name}.stl")
    assert built[name].size_m == pytest.approx(theirs.extents, abs=0.1 * theirs.extents.max())
    ours = np.concatenate([solid.vertices for solid in built[name].parts.values()])
    assert np.array([ours.min(axis=0), ours.max(axis=0)]) == pytest.approx(
        theirs.bounds, abs=0.05 * theirs.extents.max()
    )


@pytest.mark.parametrize("name", NAMES)
def test_file_holds_what_the_builder_makes(built, loaded, name):
    assert list(loaded[name].geometry) == list(built[name].parts)
    assert set(loaded[name].graph.nodes_geometry) == set(built[name].parts)
    for part, solid in built[name].parts.items():
        pose, _ = loaded[name].graph[part]
        assert np.array_equal(pose, np.eye(4))
        mesh = loaded[name].geometry[part]
        assert np.array_equal(mesh.faces, solid.facets)
        # float32 holds 16 m to half of 0.95 um
        assert np.abs(mesh.vertices - solid.vertices).max() < 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_index_says_what_the_file_is(built, name):
    entry = models()[name]
    content = entry.path.read_bytes()
    assert entry.sha256 == hashlib.sha256(content).hexdigest()
    assert entry.size_bytes == len(content)
    assert entry.facets == built[name].facet_count
    assert dict(entry.parts) == built[name].materials
    assert set(entry.parts.values()) <= set(load_materials())
    assert entry.size_m == pytest.approx(built[name].size_m, abs=1e-4)
    assert entry.center_of_mass_m == pytest.approx(built[name].center_of_mass_m, abs=1e-5)
    assert entry.licence == "MIT"


@pytest.mark.parametrize("name", NAMES)
def test_taxonomy_and_hinges_fit_the_craft(built, name):
    entry, model = models()[name], built[name]
    assert entry.taxonomy == model.taxonomy
    assert entry.taxonomy.size_class == classify_size(model.size_m.max())
    assert entry.hinges == model.hinges
    for hinge in entry.hinges:
        assert set(hinge.parts) < set(entry.parts), "something must stand still"
        # a hinge lies on what it carries or beside it, not out in space
        points = np.concatenate([model.parts[part].vertices for part in hinge.parts])
        gap = np.maximum(points.min(axis=0) - hinge.position_m, hinge.position_m - points.max(axis=0)).max()
        assert gap <= 0.05 * model.size_m.max()


@pytest.mark.parametrize("name", NAMES)
def test_inertia_is_that_of_a_possible_body(name):
    inertia = np.array(models()[name].inertia_kg_m2)
    assert np.array_equal(inertia, inertia.T)
    smallest, middle, largest = np.linalg.eigvalsh(inertia)
    assert smallest > 0.0
    assert largest <= smallest + middle + 1e-4  # rounded to five digits behind the point


def test_materials_are_whole_and_conserve_energy():
    """What a material itself checks (k_d + k_s at most 1, cubes and what is between them) in every band."""
    assert load_materials() == MATERIALS
    for name, table in MATERIALS.items():
        for wavelength_m in (400e-9, 460e-9, 535e-9, 575e-9, 625e-9, 850e-9, 1064e-9, 1570e-9):
            assert total_reflectance(table, wavelength_m) <= 1.0
            at = find_material(name, wavelength_m)
            assert float(at.brdf_per_sr(np.array(1.0))) > 0.0
        assert table["at_1570_nm"].keys() < table.keys(), name
        for key in ("what", "source", "confidence"):
            assert table[key]
        if table["type"] != "lambertian":
            assert "uncalibrated" in table["confidence"], name


def test_presets_keep_to_the_published_totals():
    """Total hemispherical reflectance at 1064 and 1570 nm of the classes, from the paper's notes on materials."""
    ranges = {
        "mli_gold": ((0.80, 0.88), (0.85, 0.90)),
        "mli_silver": ((0.90, 0.95), (0.95, 0.97)),
        "solar_cell": ((0.05, 0.15), (0.10, 0.25)),
        "solar_cell_si": ((0.30, 0.32), (0.85, 0.87)),
        "white_paint": ((0.80, 0.90), (0.65, 0.80)),
        "black_paint": ((0.04, 0.05), (0.04, 0.05)),
        "black_anodise": ((0.3, 0.6), (0.3, 0.6)),
        "aluminium": ((0.60, 0.75), (0.75, 0.85)),
        "clear_anodise": ((0.50, 0.60), (0.58, 0.62)),
        "cfrp": ((0.05, 0.10), (0.06, 0.12)),
        "osr": ((0.95, 0.97), (0.955, 0.965)),
        "aluminium_bare": ((0.945, 0.955), (0.965, 0.98)),
        "gold_bare": ((0.965, 0.98), (0.975, 0.985)),
        "silver_bare": ((0.985, 1.0), (0.985, 1.0)),
        "titanium_bare": ((0.60, 0.63), (0.65, 0.67)),
    }
    for name, bounds in ranges.items():
        table = MATERIALS[name]
        for (low, high), at in zip(bounds, (table, table["at_1570_nm"]), strict=True):
            assert low - 1e-9 <= at["diffuse"] + at["specular"] <= high + 1e-9, name


def test_presets_cite_what_was_measured_and_say_how_far_they_are_off():
    """Differences beyond twice the uncertainty are listed here, each with its reason: the others agree."""
    known = {
        "mli_gold": "flat new foil; the preset is a creased blanket",
        "mli_silver": "flat smooth metal; the preset is a creased blanket",
        "black_paint": "another paint, at the zero of its scale",
        "cfrp": "without resin, whose surface returns some 4 %",
        "osr": "silver absorbs in the blue and ultraviolet",
        "white_paint": "two paints on either side of the preset",
    }
    off = set()
    for one in MEASUREMENTS:
        table = MATERIALS[one.material]
        difference = preset_reflectance(table, one.wavelength_nm) - one.reflectance
        assert f"{one.reflectance:.2f} " in table["source"] and f"preset {difference:+.2f}" in table["source"]
        if one.wavelength_nm != SOLAR and abs(difference) > 2 * one.uncertainty:
            off.add(one.material)
    assert off <= known.keys()
    assert off == {"mli_gold", "mli_silver", "black_paint", "cfrp"}
    cell = [one for one in MEASUREMENTS if one.material == "solar_cell_si" and one.wavelength_nm != SOLAR]
    for one in cell:  # this preset is its measurement
        assert preset_reflectance(MATERIALS[one.material], one.wavelength_nm) == pytest.approx(one.reflectance)


def test_presets_have_the_colour_of_their_sample_and_say_whose_it_is():
    """Ratio to 1064 nm at each wavelength of the source, to rounding; only what is grey by definition has no spectrum."""
    assert {name for name, table in MATERIALS.items() if "below_1064_nm" not in table} == {"lambertian_30"}
    for name, table in MATERIALS.items():
        if (spectrum := SPECTRA.get(name.removesuffix("_crinkled"))) is None:
            continue
        assert list(spectrum.wavelength_nm) == sorted(spectrum.wavelength_nm) and spectrum.wavelength_nm[-1] < 1064.0
        total = [total_reflectance(table, wavelength_nm * 1e-9) for wavelength_nm in (*spectrum.wavelength_nm, 1064.0)]
        ratio = np.array(spectrum.reflectance) / spectrum.at_1064_nm
        assert np.array(total[:-1]) / total[-1] == pytest.approx(ratio, rel=0.01, abs=1e-3), name
        assert table["below_1064_nm"]["source"] and table["below_1064_nm"]["confidence"]


def test_means_over_sunlight_are_those_of_the_published_absorptances():
    """One less the solar absorptance, of the samples that span a class: within 0.06, with the reasons for more.

    Ultraviolet light, in which white paint is dark, has the reflectance of 460 nm: 0.07 too much for white paint.
    """
    more = {
        "mli_gold": 0.09,
        "titanium_bare": 0.12,
        "clear_anodise": 0.12,
    }  # creases; smooth metal; a lower class range
    published: dict[str, list[float]] = {}
    for one in MEASUREMENTS:
        if one.wavelength_nm == SOLAR:
            published.setdefault(one.material, []).append(one.reflectance)
    assert len(published) == 13
    for name, means in published.items():
        mean = preset_reflectance(MATERIALS[name], SOLAR)
        assert min(means) - more.get(name, 0.06) <= mean <= max(means) + more.get(name, 0.06), name


@pytest.mark.parametrize("name", ["mli_gold", "mli_silver"])
@pytest.mark.parametrize("wavelength_m", [1064e-9, 1570e-9])
def test_crinkled_foil_is_in_the_mean_what_its_smooth_twin_is(name, wavelength_m):
    """n = 300 with slopes of 5 degrees stands for n = 30: within a sixth where the lobe is, and closer where it is not."""
    cosine = np.cos(np.radians([0.0, 6.0, 10.0, 15.0, 30.0, 60.0]))
    smooth, crinkled = find_material(name, wavelength_m), find_material(f"{name}_crinkled", wavelength_m)
    ratio = crinkled.mean_brdf_per_sr(cosine) / smooth.brdf_per_sr(cosine)
    assert ratio[:4] == pytest.approx(1.0, abs=1 / 6)
    assert ratio[4:] == pytest.approx(1.0, abs=0.03)


def test_writing_writes_what_is_shipped(tmp_path, built):
    written = {path.name: path.read_bytes() for path in write(tmp_path)}
    assert set(written) == {*(f"{name}.glb" for name in NAMES), "index.toml", "materials.toml"}
    assert written == {name: (models()["tdrs"].path.parent / name).read_bytes() for name in written}
    assert written["tdrs.glb"] == glb(built["tdrs"])


def test_unknown_shape_is_one_line_with_a_cure():
    with pytest.raises(ScenarioError, match=r"unknown shape 'tdrss'; did you mean 'tdrs'\? \(known: tdrs, "):
        build("tdrss")


def test_every_part_of_every_model_has_a_common_class(built):
    for name, entry in models().items():
        assert entry.part_classes == built[name].part_classes
        assert list(entry.part_classes) == list(entry.parts)
    used = {kind for entry in models().values() for kind in entry.part_classes.values()}
    assert used == set(PART_CLASSES)  # no class is without a part
    known = [part for parts in PART_TABLE.values() for part in parts.split()]
    assert len(known) == len(set(known))
    # Beside the shipped models there are the fragments of a break-up, which are built from a seed.
    assert set(known) == {part for entry in models().values() for part in entry.parts} | {"fragment"}


def test_common_classes_mean_the_same_in_all_models(built):
    cells, mirrors = {"solar_cell", "solar_cell_si"}, {"osr"}
    for entry in models().values():
        for part, kind in entry.part_classes.items():
            assert (entry.parts[part] in cells) <= (kind == "solar_array"), part
            assert (entry.parts[part] in mirrors) <= (kind == "radiator"), part
            assert part.startswith("antenna_") <= (kind in ("antenna", "boom", "mechanism")), part
            assert part.startswith("boom_") <= (kind == "boom"), part
    for entry in models().values():
        if entry.taxonomy.object_class in ("payload", "capsule"):
            assert "bus" in entry.part_classes.values()
        if entry.taxonomy.object_class == "rocket_body":
            assert {"tank", "engine"} <= set(entry.part_classes.values())
        if entry.taxonomy.shape_family == "box_wing":
            assert "solar_array" in entry.part_classes.values()


def test_builders_enter_the_package_by_its_doors():
    modules = parse("models/build")
    asked = {
        (name, node.module)
        for name, tree in modules.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module.startswith("rso_lidar")
    }
    assert len(modules) > 20 and ("models/build/tdrs.py", "rso_lidar.shapes") in asked
    assert not {(name, module) for name, module in asked if module.count(".") > 1}
