"""Any file at all is a mesh or one line: cut, flipped, spliced, or saying that it holds what no machine holds."""

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rso_lidar.errors import MeshError
from rso_lidar.scene import Mesh, load_mesh
from tests.scene.meshes.test_mesh import BOX, ascii_stl, binary_stl, glb, obj, off, ply

ROOT = Path(__file__).resolve().parents[2]
HUGE = 10**12
INSTANCED = {"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"SCALE": 0}}}}
TEETH = " ".join(map(str, range(1, 30_001)))
SPARSE = {"count": 1, "indices": {"bufferView": 0, "componentType": 5125}, "values": {"bufferView": 0}}


def binary_ply(vertices=36, faces=12, extra="", count="uchar"):
    head = f"ply\nformat binary_little_endian 1.0\n{extra}element vertex {vertices}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {faces}\nproperty list {count} int vertex_indices\nend_header\n"
    corners = b"".join(struct.pack("<Biii", 3, 3 * i, 3 * i + 1, 3 * i + 2) for i in range(12))
    return head.encode() + BOX.reshape(-1, 3).astype("<f4").tobytes() + corners


def opened(blob):
    """Return the description and the buffer of a GLB."""
    length = struct.unpack_from("<I", blob, 12)[0]
    return json.loads(blob[20 : 20 + length]), blob[28 + length :]


def packed(tree, buffer):
    text = tree if isinstance(tree, bytes) else json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(buffer), 0x004E4942) + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


WHOLE = glb([("bus", BOX), ("wing", BOX + 5)], [{"mesh": 0, "children": [1]}, {"mesh": 1, "translation": [0, 1, 0]}])
GLTF = json.dumps({**opened(WHOLE)[0], "buffers": [{"byteLength": 8, "uri": "data:;base64,AAAAAAAAAAA="}]}).encode()
SOUND = [
    ("a.stl", binary_stl(BOX)),
    ("b.stl", ascii_stl(BOX)),
    ("a.ply", ply(BOX)),
    ("b.ply", binary_ply()),
    ("a.off", off(BOX)),
    ("a.obj", obj([("bus", t) for t in BOX])),
    ("a.glb", WHOLE),
    ("a.gltf", GLTF),
]
NUMBERS = [b"0", b"-1", b"nan", b"1e308", b"inf", b"4294967295", b"1000000000000", b"[", b"{}", b"null", b'"x"']


@st.composite
def spoiled(draw, blob):
    """Return a file with some bytes gone, turned, doubled, or put where others were."""
    broken = bytearray(blob)
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["cut", "flip", "word", "number", "double", "gone"]))
        at = draw(st.integers(0, max(len(broken) - 1, 0)))
        if kind == "cut":
            del broken[at:]
        elif kind == "flip" and broken:
            broken[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == "word":
            broken[at : at + 4] = draw(st.sampled_from([b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f"]))
        elif kind == "number":
            end = at + 1
            while end < len(broken) and broken[end : end + 1].isdigit():
                end += 1
            broken[at:end] = draw(st.sampled_from(NUMBERS))
        elif kind == "double":
            broken[at:at] = broken[at : at + draw(st.integers(1, 200))]
        else:
            del broken[at : at + draw(st.integers(1, 200))]
    return bytes(broken)


@pytest.mark.parametrize(("name", "blob"), SOUND, ids=[name for name, _ in SOUND])
def test_a_spoiled_file_is_a_mesh_or_one_line(name, blob, tmp_path):
    path = tmp_path / name

    @settings(max_examples=60, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(broken=spoiled(blob))
    def spoil_and_load(broken):
        path.unlink(missing_ok=True)
        path.write_bytes(broken)
        try:
            mesh = load_mesh(path)
        except MeshError as error:
            said = str(error)
        else:
            said = "a mesh; good"
            assert isinstance(mesh, Mesh) and len(mesh.facets)
            assert np.isfinite(mesh.vertices[mesh.facets]).all()
            assert mesh.source_facet.max() < mesh.source_facets
        assert "\n" not in said and ";" in said and len(said) < 600

    spoil_and_load()


def changed(**changes):
    """Return the whole GLB with some entries of its description replaced."""
    tree, buffer = opened(WHOLE)
    return packed({**tree, **changes}, buffer)


def accessor(**changes):
    first, *rest = opened(WHOLE)[0]["accessors"]
    return changed(accessors=[{key: v for key, v in {**first, **changes}.items() if v is not None}, *rest])


def gltf(uri):
    tree, _ = opened(WHOLE)
    return json.dumps({**tree, "buffers": [{"byteLength": 864, "uri": uri}]}).encode()


def instances(count):
    tree, buffer = opened(glb([("body", np.tile(BOX, (2000, 1, 1)))], [{"mesh": 0}]))
    return packed({**tree, "nodes": [{"mesh": 0}] * count, "scenes": [{"nodes": list(range(count))}]}, buffer)


def bombs():
    """Return files that ask for far more than they hold."""
    corners = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    chain = [{"children": [i + 1]} for i in range(5000)] + [{"mesh": 0}]
    pair = [{"children": [i + 1, i + 1]} for i in range(40)] + [{"mesh": 0}]
    primitives = [{"primitives": [{"attributes": {"POSITION": 0}}] * 60_000}]
    stl = binary_stl(BOX)
    return {
        "count.stl": stl[:80] + struct.pack("<I", 4_000_000_000) + stl[84:],
        "solid.stl": b"solid x".ljust(80) + struct.pack("<I", 4_000_000_000) + stl[84:],
        "words.stl": b"solid " + b"facet normal " * 1_000_000,
        "faces.ply": ply(BOX).replace(b"element face 12", b"element face %d" % HUGE),
        "vertices.ply": ply(BOX).replace(b"element vertex 36", b"element vertex %d" % HUGE),
        "faces_binary.ply": binary_ply(faces=HUGE),
        "vertices_binary.ply": binary_ply(vertices=HUGE),
        "more.ply": binary_ply(extra=f"element more {HUGE}\nproperty float a\n"),
        "list.ply": binary_ply(count="uint"),
        "zeros.ply": b"ply\n" + bytes(10_000_000),
        "faces.off": off(BOX).replace(b"36 12 0", b"36 %d 0" % HUGE),
        "vertices.off": off(BOX).replace(b"36 12 0", b"%d 12 0" % HUGE),
        "line.obj": corners + b"f " + b"1 2 3 " * 2_000_000,
        "digits.obj": corners + b"f " + b"9" * 900_000 + b" 2 3\n",
        "parts.obj": corners + b"".join(b"g p%d\nf 1 2 3\n" % i for i in range(40_000)),
        "count.glb": accessor(count=HUGE),
        "negative.glb": accessor(count=-1),
        "empty.glb": accessor(count=HUGE, bufferView=None),
        "sparse.glb": accessor(count=HUGE, sparse={"count": 1}),
        "offset.glb": accessor(byteOffset=HUGE),
        "view.glb": changed(bufferViews=[{"buffer": 0, "byteOffset": 0, "byteLength": HUGE}] * 2),
        "stride.glb": changed(bufferViews=[{"buffer": 0, "byteLength": 432, "byteStride": HUGE}] * 2),
        "circle.glb": changed(nodes=[{"children": [1]}, {"children": [0], "mesh": 0}]),
        "itself.glb": changed(nodes=[{"children": [0], "mesh": 0}, {"mesh": 0}]),
        "doubling.glb": changed(nodes=pair, scenes=[{"nodes": [0]}]),
        "deep.glb": changed(nodes=chain, scenes=[{"nodes": [0]}]),
        "instances.glb": instances(20_000),
        "pieces.glb": changed(meshes=primitives, nodes=[{"mesh": 0}]),
        "zeros.glb": accessor(count=10**8, bufferView=None, sparse=SPARSE),
        "many.glb": changed(nodes=[INSTANCED] * 50_000, scenes=[{"nodes": list(range(50_000))}]),
        "teeth.obj": b"".join(b"v %d %d 0\n" % (k, k % 2 or -k) for k in range(30_000)) + f"f {TEETH}\n".encode(),
        "teeth.off": f"OFF\n{10**9} 1 0\n{'0 0 0 ' * 9}".encode(),
        "draco.glb": changed(extensionsRequired=["KHR_draco_mesh_compression"]),
        "brackets.glb": packed(b"[" * 2_000_000, b""),
        "braces.gltf": b'{"a":' * 500_000,
        "lists.gltf": b'{"nodes":[' + b"[]," * 6_000_000 + b"[]]}",
        "number.gltf": b'{"nodes":' + b"9" * 1_000_000 + b"}",
        "network.gltf": gltf("http://192.0.2.1/a.bin"),
        "above.gltf": gltf("../above.bin"),
        "absolute.gltf": gltf("/etc/hostname"),
        "escaped.gltf": gltf("%2e%2e/above.bin"),
        "pipe.gltf": gltf("pipe.bin"),
        "missing.gltf": gltf("missing.bin"),
    }


LOOK = """
import resource, sys, time
from pathlib import Path
from rso_lidar.errors import MeshError
from rso_lidar.scene import load_mesh
from tests.scene.meshes.test_mesh import BOX, binary_stl

folder = Path(sys.argv[1])
(folder / "first.stl").write_bytes(binary_stl(BOX))
load_mesh(folder / "first.stl")  # all that is ever imported is now there
held_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for path in sorted(folder.iterdir()):
    if path.name == "first.stl" or path.suffix == ".bin":
        continue
    began_s = time.thread_time()
    try:
        said = f"a mesh of {len(load_mesh(path).facets)} facets"
    except MeshError as error:
        said = f"line: {error}"
    except BaseException as error:
        said = f"{type(error).__name__}: {error}"
    more_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held_kb) / 1024
    print(path.name, round(more_mb), round(time.thread_time() - began_s, 1), ascii(said), sep="\\t")
"""


@pytest.mark.slow
def test_no_file_takes_more_memory_or_time_than_it_is_worth(tmp_path):
    """In a process of its own, for peak memory is never given back; the bound is eight times the largest file (18 MB)."""
    folder = tmp_path / "bombs"
    folder.mkdir()
    made = bombs()
    for name, blob in made.items():
        (folder / name).write_bytes(blob)
    (tmp_path / "above.bin").write_bytes(bytes(864))
    (folder / "folder.stl").mkdir()
    with (folder / "vast.stl").open("wb") as file:
        file.truncate(2**39)  # holes only: it takes no disk
    os.mkfifo(folder / "pipe.bin")
    os.mkfifo(folder / "pipe.stl")
    for name, target in (("circle.stl", "circle.stl"), ("zero.stl", "/dev/zero"), ("nowhere.stl", "nowhere")):
        (folder / name).symlink_to(target)
    if Path("/proc/self/mem").exists():
        (folder / "unreadable.stl").symlink_to("/proc/self/mem")
    found = subprocess.run(
        [sys.executable, "-c", LOOK, str(folder)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr
    lines = [line.split("\t") for line in found.stdout.splitlines()]
    assert {name for name, *_ in lines} >= {*made, "vast.stl", "pipe.stl", "zero.stl", "folder.stl", "nowhere.stl"}
    for name, more_mb, took_s, said in lines:
        assert said.startswith(("'line: ", '"line: ')), f"{name}: {said}"
        assert "\\n" not in said and ";" in said and len(said) < 600, f"{name}: {said}"
        assert int(more_mb) < 150, f"{name}: {more_mb} MB more than before"
        assert float(took_s) < 5.0, f"{name}: {took_s} s"
