import base64
import json
import os
import struct

import numpy as np
import pytest

from rso_lidar.errors import MeshError
from rso_lidar.scene import load_mesh, read_facet_colours
from tests.optics.bench_for_tests import box
from tests.scene.meshes.test_mesh import load  # noqa: F401, a fixture

BOX = box(1.0, 2.0, 3.0).reshape(-1, 3)
PLATE = np.array([(0, 0, 0), (1, 0, 0), (1, 3, 0)], dtype=float)
TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
WIDTHS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def pack(tree, arrays=(), stride=0):
    """Return a GLB of a tree, to which an accessor is added for each array: its values, or (values, more keys)."""
    blob, views, accessors = b"", [], []
    for array in arrays:
        values, more = array if isinstance(array, tuple) else (array, {})
        values = np.asarray(values, dtype=np.float32 if values.dtype == float else values.dtype)
        rows = values.reshape(len(values), -1)
        step = max(stride, rows[0].nbytes)
        data = b"".join(row.tobytes().ljust(step, b"\xee") for row in rows)
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data), "byteStride": step})
        kind = {"componentType": TYPES[values.dtype.str[1:]], "type": WIDTHS[rows.shape[1]]}
        accessors.append({"bufferView": len(views) - 1, "count": len(rows), **kind, **more})
        blob += data + bytes(-len(data) % 4)
    whole = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}]}
    whole |= {"meshes": [{"name": "bus", "primitives": [{"attributes": {"POSITION": 0}}]}]}
    whole |= {"accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(blob)}], **tree}
    text = json.dumps(whole).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def mesh(*primitives, **more):
    return {
        "name": "bus",
        "primitives": [{"attributes": {"POSITION": 0}, **one} for one in primitives or ({},)],
        **more,
    }


def corners(loaded):
    return loaded.vertices[loaded.facets].reshape(-1, 3)


@pytest.mark.parametrize(
    ("kind", "normalized", "scale"),
    [
        ("i2", True, 32767),
        ("u2", True, 65535),
        ("i1", True, 127),
        ("u1", True, 255),
        ("i2", False, 1),
        ("u1", False, 1),
    ],
)
@pytest.mark.parametrize("stride", [0, 12])
def test_positions_as_integers_have_their_scale(load, kind, normalized, scale, stride):  # noqa: F811
    """A node undoes the scale, as gltfpack writes it."""
    values = (42 * PLATE).astype(kind)
    nodes = [{"mesh": 0, "scale": [3.0, 3.0, 3.0]}]
    tree = {"nodes": nodes, "extensionsRequired": ["KHR_mesh_quantization"]}
    loaded = load("a.glb", pack(tree, [(values, {"normalized": normalized})], stride))
    assert corners(loaded) == pytest.approx(PLATE * (3 * 42 / scale), rel=1e-14)


def test_the_lowest_signed_integer_counts_as_minus_one(load):  # noqa: F811
    values = np.array([(-128, 0, 0), (127, 0, 0), (0, 127, 0)], dtype=np.int8)
    assert load("a.glb", pack({}, [(values, {"normalized": True})])).size_m.tolist() == [2, 1, 0]


@pytest.mark.parametrize(
    ("mode", "expected"),
    [(5, [[0, 1, 2], [2, 1, 3], [2, 3, 4]]), (6, [[0, 1, 2], [0, 2, 3], [0, 3, 4]])],
    ids=["strip", "fan"],
)
@pytest.mark.parametrize("with_indices", [False, True])
def test_strips_and_fans_are_triangles(load, mode, expected, with_indices):  # noqa: F811
    points = np.array([(0, 0, 0), (2, 0, 0), (3, 1, 0), (1, 4, 0), (0, 2, 1)], dtype=float)
    order = np.array([4, 3, 2, 1, 0], dtype=np.uint16)
    primitive = {"mode": mode} | ({"indices": 1} if with_indices else {})
    stored = points[::-1] if with_indices else points
    loaded = load("a.glb", pack({"meshes": [mesh(primitive)]}, [stored, order]))
    assert np.array_equal(corners(loaded), points[expected].reshape(-1, 3))


def test_instances_are_placed_turned_and_scaled(load):  # noqa: F811
    half = np.sqrt(0.5)
    places = np.array([(0, 0, 0), (10, 0, 0)], dtype=float)
    turns = np.array([(0, 0, 0, 1), (0, 0, half, half)])
    sizes = np.array([(1, 1, 1), (2, 1, 1)], dtype=float)
    attributes = {"TRANSLATION": 1, "ROTATION": 2, "SCALE": 3}
    nodes = [
        {"mesh": 0, "translation": [0, 0, 5], "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}
    ]
    loaded = load("a.glb", pack({"nodes": nodes}, [PLATE, places, turns, sizes]))
    second = np.stack([10 - PLATE[:, 1], 2 * PLATE[:, 0], PLATE[:, 2] + 5], axis=1)
    assert corners(loaded) == pytest.approx(np.concatenate([PLATE + np.array([0, 0, 5]), second]), abs=1e-6)
    assert loaded.part_names == ("bus",)


@pytest.mark.parametrize(
    ("of_mesh", "of_node", "lift"),
    [([0.5, 1.0], None, 3.0), ([0.5, 1.0], [1.0, 0.0], 2.0), (None, [0.0, 0.5], 1.0), (None, None, 0.0)],
)
def test_default_weights_move_morph_targets_and_a_node_s_replace_those_of_its_mesh(load, of_mesh, of_node, lift):  # noqa: F811
    first, second = np.zeros((2, 3, 3))
    first[2], second[2] = (0, 0, 2), (0, 0, 2)
    targets = {"targets": [{"POSITION": 1}, {"POSITION": 2}]}
    tree = {
        "meshes": [mesh(targets, **({} if of_mesh is None else {"weights": of_mesh}))],
        "nodes": [{"mesh": 0} | ({} if of_node is None else {"weights": of_node})],
    }
    loaded = load("a.glb", pack(tree, [PLATE, first, second]))
    assert corners(loaded)[2].tolist() == [1, 3, lift]


def test_joints_move_a_skin_and_its_own_node_does_not(load):  # noqa: F811
    """Joint 1 stays where it was bound, joint 2 has moved by (0, 0, 4): the last corner follows it by three quarters."""
    joints = np.array([(0, 0, 0, 0), (0, 1, 0, 0), (0, 1, 0, 0)], dtype=np.uint8)
    weights = np.array([(1, 0, 0, 0), (1, 0, 0, 0), (0.25, 0.75, 0, 0)])
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[1, :3, 3] = (0, -1, 0)
    skinned = {"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}
    nodes = [
        {"mesh": 0, "skin": 0, "translation": [9, 9, 9]},
        {"children": [2]},
        {"translation": [0, 1, 4]},
    ]
    tree = {
        "meshes": [{"primitives": [skinned]}],
        "nodes": nodes,
        "scenes": [{"nodes": [0, 1]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 3}],
    }
    blob = pack(tree, [PLATE, joints, weights, inverse.transpose(0, 2, 1)])
    assert corners(load("a.glb", blob)) == pytest.approx(PLATE + np.diag([0.0, 0.0, 3.0]), abs=1e-12)


def test_sparse_values_replace_those_of_their_accessor(load):  # noqa: F811
    sparse = {"count": 1, "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 2}}
    arrays = [(PLATE, {"sparse": sparse}), np.array([2], dtype=np.uint8), np.array([(1.0, 5.0, 2.0)])]
    assert corners(load("a.glb", pack({}, arrays)))[2].tolist() == [1, 5, 2]
    wrong = [arrays[0], np.array([3], dtype=np.uint8), arrays[2]]
    with pytest.raises(MeshError, match="has sparse data for values that it does not have"):
        load("b.glb", pack({}, wrong))


def test_nodes_that_share_a_mesh_are_parts_by_their_names_in_the_order_of_meshes(load):  # noqa: F811
    nodes = [
        {"mesh": 1, "name": "wing_left", "translation": [0, 5, 0]},
        {"mesh": 0, "name": "hull"},
        {"mesh": 1, "name": "wing_right", "translation": [0, -5, 0]},
        {"mesh": 1},
        {"mesh": 1, "name": "bus"},
    ]
    meshes = [mesh(), {"name": "wing", "primitives": [{"attributes": {"POSITION": 1}}] * 2}]
    loaded = load(
        "a.glb", pack({"nodes": nodes, "scenes": [{"nodes": [0, 1, 2, 3, 4]}], "meshes": meshes}, [BOX, PLATE])
    )
    wings = ("wing_left", "wing_right", "wing", "bus_1")
    assert set(loaded.part_names) == {"bus", *wings, "wing_left_1", "wing_right_1", "wing_1", "bus_2"}
    assert loaded.part_names[:5] == ("bus", *wings)
    left = loaded.facets[loaded.part == loaded.part_names.index("wing_left")]
    assert np.array_equal(loaded.vertices[left].reshape(-1, 3), PLATE + np.array([0, 5, 0]))


def test_hidden_nodes_hide_their_children_and_nodes_outside_the_scene_are_not_in_it(load):  # noqa: F811
    hidden = {"KHR_node_visibility": {"visible": False}}
    nodes = [
        {"mesh": 0},
        {"mesh": 0, "translation": [9, 0, 0], "extensions": hidden, "children": [2]},
        {"mesh": 0},
        {"mesh": 0, "translation": [0, 0, 7]},
    ]
    tree = {"nodes": nodes, "scenes": [{"nodes": [0, 1]}, {"nodes": [3]}]}
    assert load("a.glb", pack(tree, [PLATE])).size_m.tolist() == [1, 3, 0]
    assert load("b.glb", pack({**tree, "scene": 1}, [PLATE])).vertices[:, 2].tolist() == [7, 7, 7]
    for bare in ({"scenes": []}, {"scenes": [{"nodes": [0, 1, 3]}]}):
        assert load("c.glb", pack({**tree, **bare}, [PLATE])).size_m.tolist() == [1, 3, 7]
    with pytest.raises(MeshError, match="its scene shows none of its meshes"):
        load("d.glb", pack({**tree, "scenes": [{"nodes": [1]}]}, [PLATE]))


def on_node(name, content=None):
    return {"nodes": [{"mesh": 0, "extensions": {name: content or {}}}], "extensionsUsed": [name]}


@pytest.mark.parametrize(
    ("tree", "says"),
    [
        ({"extensionsRequired": ["ACME_bend"]}, "uses ACME_bend, which may change its geometry and is not read"),
        (on_node("ACME_bend"), "uses ACME_bend, which may"),
        ({"extensionsRequired": ["ACME\n\x1b[1m"]}, r"uses ACME\?\?\[1m, which may"),
        (
            {"nodes": [{"mesh": 0, "matrix": [1e308] * 16, "children": [1]}, {"matrix": [1e308] * 16}]},
            "without area|finite",
        ),
        ({"extensions": {"CESIUM_RTC": {"center": [1, 2, 3]}}}, "uses CESIUM_RTC, which may"),
        ({"extensionsRequired": ["ACME_b", "ACME_a"]}, "uses ACME_a, ACME_b, which may"),
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "is compressed with KHR_draco_mesh_compression"),
        ({"extensionsRequired": ["EXT_meshopt_compression"]}, "is compressed with EXT_meshopt_compression"),
        ({"asset": {"version": "1.0"}, "meshes": {}}, "is glTF of version 1.0, which is not read"),
        ({"meshes": {}, "asset": {}}, "is glTF of version 1.0, which is not read"),
        ({"asset": {"version": "2.0", "minVersion": "2.1"}}, "is glTF of version 2.1"),
        ({"nodes": [{"mesh": 0, "rotation": [0, 0, 0, 0]}]}, "'rotation' of four zeros"),
        ({"nodes": [{"mesh": 0, "matrix": [1, 0]}]}, r"'matrix' is \[1, 0\] and not numbers as glTF defines them"),
        ({"nodes": [{"mesh": 0, "skin": 0}]}, "names skin 0 of 0"),
        (on_node("EXT_mesh_gpu_instancing", {"attributes": {}}), "EXT_mesh_gpu_instancing has no places"),
        ({"buffers": [{"byteLength": 36, "uri": "data:;base64,AAAA"}]}, "has 3 of the 36 bytes that it states"),
        (
            {
                "extensions": {
                    "AGI_articulations": {
                        "articulations": [{"name": "wing", "stages": [{"type": "yRotate", "initialValue": 30}]}]
                    }
                }
            },
            "AGI_articulations turns or moves 'wing' at the start",
        ),
    ],
)
def test_what_is_not_applied_is_refused_by_name(load, tree, says):  # noqa: F811
    with pytest.raises(MeshError, match=says) as refused:
        load("a.glb", pack(tree, [PLATE]))
    assert "; " in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "tree",
    [
        {"extensionsRequired": ["KHR_materials_unlit", "KHR_texture_transform", "KHR_texture_basisu"]},
        on_node("KHR_lights_punctual", {"light": 0}),
        on_node("AGI_stk_metadata"),
        {"meshes": [mesh({"extensions": {"EXT_mesh_features": {}, "KHR_materials_variants": {}}})]},
        {"materials": [{"extensions": {"ACME_paint": {}}}], "extensionsUsed": ["ACME_paint"]},
        {
            "extensionsUsed": ["KHR_draco_mesh_compression"],
            "meshes": [mesh({"extensions": {"KHR_draco_mesh_compression": {}}})],
        },
        {
            "extensionsUsed": ["EXT_meshopt_compression"],
            "buffers": [
                {
                    "byteLength": 36,
                    "uri": "data:;base64," + base64.b64encode(PLATE.astype("f4").tobytes()).decode(),
                    "extensions": {"EXT_meshopt_compression": {"fallback": True}},
                }
            ],
        },
    ],
)
def test_extensions_that_leave_the_shape_alone_do_no_harm(load, tree):  # noqa: F811
    """The data beside a compressed copy that is not required are whole (KHR_draco_mesh_compression, fallback)."""
    assert np.array_equal(corners(load("a.glb", pack(tree, [PLATE]))), PLATE)


def test_pictures_are_not_opened_and_data_that_are_no_plain_file_are_one_line(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    texture = {"index": 0}
    material = {
        "pbrMetallicRoughness": {"baseColorTexture": texture, "baseColorFactor": [1.0, 0.5, 0.0, 1.0]},
        "extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": texture}},
    }
    tree = {
        "images": [{"uri": "pipe"}],
        "textures": [{"source": 0}],
        "materials": [material],
        "meshes": [mesh({"material": 0})],
    }
    (tmp_path / "a.glb").write_bytes(pack(tree, [PLATE]))
    loaded = load_mesh(tmp_path / "a.glb")
    assert read_facet_colours(loaded).tolist() == ["#ff8000"]
    for uri in ("pipe", "."):
        (tmp_path / "b.glb").write_bytes(pack({"buffers": [{"byteLength": 36, "uri": uri}]}, [PLATE]))
        with pytest.raises(MeshError, match=r"is not there; put it beside|outside its folder"):
            load_mesh(tmp_path / "b.glb")


def test_many_pieces_of_one_array_take_its_vertices_once(load):  # noqa: F811
    """A piece keeps the vertices that it uses: without, 40 pieces of 10,000 vertices would have 400,000."""
    points = np.random.default_rng(1).integers(-999, 999, (10_000, 3)).astype(float)
    pieces = [{"indices": 1 + k} for k in range(40)]
    indices = [np.array([k, k + 1, 9_999], dtype=np.uint16) for k in range(40)]
    loaded = load("a.glb", pack({"meshes": [mesh(*pieces)]}, [points, *indices]))
    assert len(loaded.vertices) == 120
    assert np.array_equal(corners(loaded).reshape(-1, 3, 3)[7], points[[7, 8, 9_999]])
