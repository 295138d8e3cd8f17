"""STEP and IGES: solids tessellated by Open CASCADE, which the extra `step` installs."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

from rso_lidar.errors import MeshError
from rso_lidar.interruption import make_temporary_folder, remove_on_signal
from rso_lidar.scene.meshes.mesh import CAD_SUFFIXES, checked_file

CHORD_MM, TURN_RAD = 1.0, 0.2  # greatest distance of a facet from the surface, and angle between neighbours
_MM = 1e-3
_LONGEST_S = 180
_MOST_MEMORY = 8 * 2**30

# In a separate process: on a broken solid the library may crash or never return, and it prints to the terminal.
_TESSELLATE = """
import sys
from pathlib import Path
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, ({most}, {most}))
except (ImportError, ValueError, OSError):
    pass
import cascadio
source, kind, out = sys.argv[1:]
blob = cascadio.load(Path(source).read_bytes(), file_type=kind, tol_linear={chord}, tol_angular={turn}, use_parallel=False)
Path(out).write_bytes(blob)
"""


def is_cad(path: Path) -> bool:
    """Return whether a file is STEP or IGES, by its name."""
    return path.suffix.lower() in CAD_SUFFIXES


def tessellate(path: Path) -> tuple[bytes, float]:
    """Tessellate a STEP or IGES file; return it as GLB, with the metres of its unit.

    STEP names its unit. IGES is in millimetres. A `MeshError` is raised where the file contains no solid.
    """
    checked_file(path, CAD_SUFFIXES)
    if importlib.util.find_spec("cascadio") is None:
        raise MeshError(
            f"{path}: STEP and IGES need the extra 'step' (pip install 'rso-lidar[step]'); "
            "or export the part as GLB or STL from the program that drew it, or from FreeCAD"
        )
    kind = "step" if path.suffix.lower() in (".step", ".stp") else "iges"
    code = _TESSELLATE.format(most=_MOST_MEMORY, chord=CHORD_MM, turn=TURN_RAD)
    with make_temporary_folder() as folder:
        out = Path(folder, "part.glb")
        command = [sys.executable, "-c", code, str(path.resolve()), kind, str(out)]
        nothing = subprocess.DEVNULL
        with (
            subprocess.Popen(command, stdin=nothing, stdout=nothing, stderr=nothing) as process,
            remove_on_signal(process.kill),
        ):
            try:
                status = process.wait(_LONGEST_S)
            except subprocess.TimeoutExpired:
                raise MeshError(
                    f"{path.name}: takes over {_LONGEST_S} s to make triangles of; export it as STL"
                ) from None
            finally:
                process.kill()
        blob = out.read_bytes() if status == 0 and out.exists() else b""
    if not blob:
        raise MeshError(
            f"{path.name}: cannot be read as {kind.upper()}, or contains no solid; export it again, or as STL"
        )
    return blob, 1.0 if kind == "step" else _MM
