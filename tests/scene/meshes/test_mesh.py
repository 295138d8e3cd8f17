import json
import struct
import warnings

import numpy as np
import pytest

from rso_lidar.errors import MeshError, RsoLidarWarning
from rso_lidar.scene import load_mesh, warn_of_size
from tests.optics.bench_for_tests import box, plate

BOX = box(1.0, 2.0, 3.0)


def binary_stl(triangles, header=b"a box"):
    records = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    records["corners"] = triangles
    return header.ljust(80, b" ") + struct.pack("<I", len(triangles)) + records.tobytes()


def ascii_stl(triangles):
    lines = ["solid box"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x:g} {y:g} {z:g}" for x, y, z in triangle)]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid box", ""]).encode()


def ply(triangles):
    corners = np.reshape(triangles, (-1, 3))
    lines = ["ply", "format ascii 1.0", f"element vertex {len(corners)}", *(f"property float {a}" for a in "xyz")]
    lines += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
    lines += [f"{x:g} {y:g} {z:g}" for x, y, z in corners]
    return "\n".join(lines + [f"3 {3 * i} {3 * i + 1} {3 * i + 2}" for i in range(len(triangles))] + [""]).encode()


def off(triangles):
    corners = np.reshape(triangles, (-1, 3))
    lines = ["OFF", f"{len(corners)} {len(triangles)} 0", *(f"{x:g} {y:g} {z:g}" for x, y, z in corners)]
    return "\n".join(lines + [f"3 {3 * i} {3 * i + 1} {3 * i + 2}" for i in range(len(triangles))] + [""]).encode()


def obj(groups, word="g"):
    """Return an OBJ of (group, triangle) in this order; a group is named again where it changes."""
    lines, last, count = [], None, 0
    for _, triangle in groups:
        lines += [f"v {x:g} {y:g} {z:g}" for x, y, z in triangle]
    for name, _ in groups:
        if name != last:
            lines.append(f"{word} {name}")
        lines.append(f"f {count + 1} {count + 2} {count + 3}")
        last, count = name, count + 3
    return "\n".join([*lines, ""]).encode()


def glb(meshes, nodes):
    """Return a GLB, written by hand: meshes (name, triangles), nodes of the glTF with mesh numbers and children."""
    blob, views, accessors, entries = b"", [], [], []
    for name, triangles in meshes:
        data = np.asarray(triangles, dtype="<f4").reshape(-1, 3)
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": data.nbytes, "target": 34962})
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": 5126,
                "count": len(data),
                "type": "VEC3",
                "min": data.min(axis=0).tolist(),
                "max": data.max(axis=0).tolist(),
            }
        )
        entries.append({"name": name, "primitives": [{"attributes": {"POSITION": len(accessors) - 1}}]})
        blob += data.tobytes()
    children = {child for node in nodes for child in node.get("children", [])}
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [i for i in range(len(nodes)) if i not in children]}],
        "nodes": nodes,
        "meshes": entries,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


@pytest.fixture
def load(tmp_path):
    """Write bytes to a file of this name and load it."""

    def write_and_load(name, data):
        path = tmp_path / name
        path.write_bytes(data)
        return load_mesh(path)

    return write_and_load


def corners(mesh):
    return mesh.vertices[mesh.facets]


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("box.stl", binary_stl(BOX)),
        ("solid.stl", binary_stl(BOX, b"solid exported by a well-known program")),
        ("BOX.STL", ascii_stl(BOX)),
        ("box.ply", ply(BOX)),
        ("box.off", off(BOX)),
        ("box.obj", obj([("body", t) for t in BOX])),
        ("box.glb", glb([("body", BOX)], [{"mesh": 0}])),
    ],
)
def test_every_format_gives_the_same_triangles_in_the_file_s_order(load, name, data):
    mesh = load(name, data)
    assert np.array_equal(corners(mesh), BOX)
    assert mesh.source_facet.tolist() == list(range(12))
    assert mesh.part_names == ("body",) and mesh.part.tolist() == [0] * 12
    assert (mesh.source_facets, mesh.degenerate) == (12, 0)
    assert mesh.size_m.tolist() == [1, 2, 3]


def test_facets_without_area_are_dropped_and_the_others_keep_their_numbers(load):
    point, line = np.zeros((1, 3, 3)), np.array([[[0, 0, 0], [1, 1, 1], [2, 2, 2]]])
    mesh = load("box.stl", binary_stl(np.concatenate([point, BOX[:5], line, line, BOX[5:], point])))
    assert np.array_equal(corners(mesh), BOX)
    assert mesh.source_facet.tolist() == [1, 2, 3, 4, 5, *range(8, 15)]
    assert (mesh.source_facets, mesh.degenerate) == (16, 4)


def test_slivers_and_tiny_facets_are_kept(load):
    sliver = np.array([[[0, 0, 0], [1, 0, 0], [0.5, 1e-5, 0]]])
    assert load("a.stl", binary_stl(np.concatenate([sliver, BOX * 1e-4]))).degenerate == 0


@pytest.mark.parametrize("word", ["g", "o"])
@pytest.mark.parametrize(
    "names", [["bus", "wing"], ["wing", "bus"], ["a", "b", "c"], ["bus", "wing", "bus"]], ids=" ".join
)
def test_groups_of_an_obj_are_parts_and_facets_keep_the_number_of_their_line(load, word, names):
    """The label `facet` is the index in the source file (conventions.md): the n-th f line, whatever group it is in."""
    triangles = [plate(1.0 + i)[0] + [0, 0, i] for i in range(2 * len(names))]
    groups = [(names[i // 2], triangle) for i, triangle in enumerate(triangles)]
    mesh = load("two.obj", obj(groups, word))
    assert sorted(mesh.part_names) == sorted(set(names))
    for triangle, part, number in zip(corners(mesh), mesh.part, mesh.source_facet, strict=True):
        assert np.array_equal(triangle, triangles[number])
        assert mesh.part_names[part] == groups[number][0]
    assert mesh.part_names == tuple(dict.fromkeys(names)), "parts in the order of the file"


def test_nodes_of_a_glb_move_and_turn_its_meshes(load):
    """A quarter turn about z then a step along x for the child, a step along z for its parent: child = parent * own."""
    quarter = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]
    nodes = [
        {"name": "root", "translation": [0, 0, 10], "children": [1]},
        {"name": "turned", "mesh": 0, "translation": [5, 0, 0], "rotation": quarter},
    ]
    mesh = load("box.glb", glb([("bus", BOX)], nodes))
    x, y, z = BOX[..., 0], BOX[..., 1], BOX[..., 2]
    assert np.allclose(corners(mesh), np.stack([5 - y, x, z + 10], axis=-1), rtol=0, atol=1e-6)


def test_meshes_of_a_glb_are_parts_in_the_file_s_order(load):
    meshes = [("bus", BOX), ("wing", plate(4.0)), ("dish", plate(2.0, n=2))]
    nodes = [{"mesh": 0}, {"mesh": 1, "translation": [0, 3, 0]}, {"mesh": 2, "translation": [0, 0, 2]}]
    mesh = load("sat.glb", glb(meshes, nodes))
    assert set(mesh.part_names) == {"bus", "wing", "dish"}
    number_of = {name: np.flatnonzero(mesh.part == i) for i, name in enumerate(mesh.part_names)}
    assert np.allclose(corners(mesh)[number_of["wing"]], plate(4.0) + np.array([0, 3, 0]), rtol=0, atol=1e-6)
    assert mesh.part_names == ("bus", "wing", "dish")
    assert np.allclose(
        corners(mesh), np.concatenate([BOX, plate(4.0) + np.array([0, 3, 0]), plate(2.0, n=2) + np.array([0, 0, 2])])
    )


QUAD = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"


def test_a_quad_is_two_triangles(load):
    mesh = load("quad.obj", QUAD)
    edges = np.cross(corners(mesh)[:, 1] - corners(mesh)[:, 0], corners(mesh)[:, 2] - corners(mesh)[:, 0])
    assert len(mesh.facets) == 2 and np.allclose(np.abs(edges[:, 2]), 1)


@pytest.mark.parametrize(
    "text",
    [
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n",
        b"# made by hand\r\nmtllib none.mtl\r\nv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nvn 0 0 1\r\nvt 0 0\r\n"
        b"usemtl x\r\ns off\r\nf 1/1/1 2//1 3/1\r\n",
        b"v 0 0 0 1.0\nv 1 0 0 1.0\nv 0 1 0 1.0\nl 1 2\np 3\nf 1 2 3 # the only one\n",
        b"v 0 0 0 0.5 0.5 0.5\nv 1 0 0 0.5 0.5 0.5\nv 0 1 0 0.1 0.1 0.1\nf 1 2 \\\n3\n",
        b"\tv  0.0e0\t0 0\n v +1 0. 0\nv 0 1e0 -0\n\nf\t1 2 3",
    ],
    ids=["backwards", "corners with texture and normal", "weights, lines and points", "colours", "blanks"],
)
def test_what_an_obj_may_say_beside_facets(load, text):
    mesh = load("one.obj", text)
    assert corners(mesh).tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]
    assert len(mesh.part_names) == 1


def spoiled(value):
    triangles = BOX.copy()
    triangles[7, 1, 2] = value
    return binary_stl(triangles)


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("zero.stl", b"", "the file is empty"),
        ("head.stl", binary_stl(BOX[:0]), "no triangles"),
        ("short.stl", binary_stl(BOX)[:40], "is neither ASCII STL"),
        ("cut.stl", binary_stl(BOX)[:-60], "promises 12 facets and 10 are there"),
        ("cut2.stl", binary_stl(BOX, b"solid, says a binary file")[:-1], "promises 12 facets and 11 are there"),
        ("cut3.stl", ascii_stl(BOX)[:700], ""),
        ("cut4.stl", ascii_stl(BOX).replace(b"endsolid box\n", b""), ""),
        (
            "words.stl",
            b"This is a letter to my aunt.\n" * 30,
            "is neither ASCII STL, which begins with 'solid', nor binary",
        ),
        ("nan.stl", spoiled(np.nan), "1 of 12 facets have coordinates that are not finite, the first is facet 7"),
        ("inf.stl", spoiled(-np.inf), "the first is facet 7"),
        ("points.stl", binary_stl(np.zeros((3, 3, 3))), "all 3 facets are without area"),
        ("words.obj", b"hello world\n", "no triangles"),
        ("bad.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", ""),
        ("nan.obj", b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles"),
        ("words.ply", b"hello world\n", ""),
        ("cut.ply", ply(BOX)[:-100], ""),
        ("zero.glb", b"", "the file is empty"),
        ("words.glb", b"hello world\n" * 9, ""),
        ("cut.glb", glb([("body", BOX)], [{"mesh": 0}])[:-40], ""),
        ("cut2.glb", glb([("body", BOX)], [{"mesh": 0}])[:100], ""),
        ("empty.gltf", b"{}", ""),
        ("words.off", b"hello", ""),
        ("part.step", b"ISO-10303-21;", "a mesh of type '.step' is not read; convert it to one of .stl"),
        ("noname", b"x", "is not read"),
    ],
)
def test_a_bad_file_gets_one_line_that_names_it(load, name, data, says):
    with pytest.raises(MeshError) as caught:
        load(name, data)
    message = str(caught.value)
    assert name in message and says in message
    assert "\n" not in message and ";" in message, "what is wrong; what to do"
    assert "No module named" not in message, "the reader's own troubles are no help to the user"


def test_a_missing_file(tmp_path):
    with pytest.raises(MeshError, match="no such file; check the name"):
        load_mesh(tmp_path / "nowhere.stl")


def test_vertices_that_no_facet_uses_do_no_harm(load):
    mesh = load("spare.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1e6 0 0\nv nan nan nan\nf 1 2 3\n")
    assert mesh.size_m.tolist() == [1, 1, 0]


def test_a_file_that_changes_is_read_again(load):
    assert len(load("box.stl", binary_stl(BOX)).facets) == 12
    assert len(load("box.stl", binary_stl(BOX[:6])).facets) == 6


@pytest.mark.parametrize(
    ("scale", "says"),
    [
        (1000.0, "may be in millimetres"),  # a box of 3 m drawn in millimetres
        (1.0, None),
        (1e-3, "give scale or size_m"),
        (1e9, "give scale or size_m"),
    ],
)
def test_a_size_that_no_spacecraft_has_is_doubted(load, scale, says):
    mesh = load("box.stl", binary_stl(BOX))
    if says is None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warn_of_size(mesh, scale, "sat")
    else:
        with pytest.warns(RsoLidarWarning, match=says):
            warn_of_size(mesh, scale, "sat")


def test_real_spacecraft_have_the_size_and_the_triangles_that_their_manifest_says(shared):
    """The manifest of the data folder was written with other tools; its extents are rounded to 0.1 mm."""
    models = json.loads((shared / "meshes" / "manifest.json").read_text())["models"]
    seen = 0
    for entry in models.values():
        if entry["bytes"] > 1_700_000:
            continue
        mesh = load_mesh(shared / "meshes" / entry["file"])
        assert mesh.source_facets == entry["triangles"]
        assert mesh.sha256 == entry["sha256"]
        assert mesh.size_m == pytest.approx(entry["extents_m"], abs=1e-4)
        seen += 1
    assert seen >= 3


def test_a_glb_whose_positions_are_not_three_numbers_is_one_line(load):
    """One digit changed: the positions are read from the accessor of the indices."""
    sound = glb([("body", BOX)], [{"mesh": 0}])
    assert sound.count(b'"VEC3"') == 1
    with pytest.raises(MeshError, match="positions that are not three numbers each; export it again"):
        load("a.glb", sound.replace(b'"VEC3"', b'"VEC2"'))


def test_numbers_lost_in_an_ascii_stl_are_an_error_and_nobody_logs(load, caplog, capfd):
    sound = ascii_stl(BOX)
    for old, new in (
        (b"normal 0 0 0", b"normal 0.0!0.0 0"),
        (b"vertex 0.5", b"vertex 0.0!0.5"),
        (b"vertex 0.5 ", b"vertex "),
    ):
        with pytest.raises(MeshError, match="cannot be read as STL: it is cut short or damaged; export it again"):
            load("a.stl", sound.replace(old, new, 1))
    assert caplog.text == ""
    assert capfd.readouterr() == ("", "")


def test_an_ascii_stl_that_breaks_off_between_facets_is_an_error(load):
    sound = ascii_stl(BOX)
    end = sound.rindex(b"facet normal")
    with pytest.raises(MeshError, match="has no 'endsolid' at its end, so it is cut short"):
        load("a.stl", sound[:end])


@pytest.mark.parametrize(
    ("name", "sound", "old", "new"),
    [
        ("a.ply", ply(BOX), b"property float x", b"property float q"),
        ("a.ply", ply(BOX), b"3 0 1 2", b"3 0 1 x"),
        ("a.ply", ply(BOX), b"property list", b"property lust"),
        ("a.off", off(BOX), b"36 12 0", b"36 1! 0"),
        ("a.off", off(BOX), b"0.5", b"0.5!"),
    ],
)
def test_no_words_of_python_in_a_message(load, name, sound, old, new):
    assert old in sound
    with pytest.raises(MeshError) as refused:
        load(name, sound.replace(old, new, 1))
    assert str(refused.value).endswith("it is cut short or damaged; export it again")
