"""The tests as on another processor: `python -m tests.processor <arguments of pytest>`, by default those of `REPEATED`.

NumPy, its BLAS, the C library and numba each choose their code by the processor they find. Here they are told to take what
the oldest one has, which rounds otherwise: what hangs on the last bit comes out differently.
"""

import os
import platform
import sys
from pathlib import Path


def other_processor() -> dict[str, str]:
    """Return the environment variables that hide what this processor can do beyond the oldest of its kind."""
    from numpy._core import _multiarray_umath as numpy_core

    # NumPy's own list: the names of features and groups change with its releases, and unknown ones are refused.
    optional = [name for name in numpy_core.__cpu_dispatch__ if numpy_core.__cpu_features__[name]]
    kept = os.environ.get("NPY_DISABLE_CPU_FEATURES", "").replace(",", " ").split()
    variables = {"NPY_DISABLE_CPU_FEATURES": " ".join([*kept, *optional]), "NUMBA_CPU_NAME": "generic"}
    if platform.machine().lower() in ("x86_64", "amd64"):
        variables["OPENBLAS_CORETYPE"] = "Prescott"
        if sys.platform == "linux":
            variables["GLIBC_TUNABLES"] = "glibc.cpu.hwcaps=-AVX2,-AVX512F,-FMA,-FMA4"
    return variables


def dispatched() -> list[str]:
    """Return what NumPy uses here beyond the oldest processor."""
    from numpy._core import _multiarray_umath as numpy_core

    return [name for name in numpy_core.__cpu_dispatch__ if numpy_core.__cpu_features__[name]]


# Folders of tests that compare numbers. Those of rooms that compute them are repeated; `tolerances` examines all.
REPEATED = (
    "shapes", "models", "golden", "property", "orbit", "rpo", "motion", "track", "optics", "scene", "imaging", "detector",
    "sensors", "simulation", "records",
)  # fmt: skip
LEFT_OUT = {
    "physics": "compares with closed forms and published values, far coarser than rounding",
    "study": "sums and ranks what the rooms above compute",
    "mission_analysis": "sums and draws what they compute",
    "evaluation": "compares what they computed with its truth",
    "studio": "compares places on a page",
    "scenario": "composes, describes and checks what they compute",
    "dataset": "compares draws by their statistics",
    "loop": "compares flights with flights on the same processor",
    "export": "compares files with what was written into them",
    "fmi": "compares FMUs with the same simulation",
    "picture": "compares places on a page",
    "cli": "compares printed numbers",
    "part": "compares units",
    "peers": "compares with other programs to per cents",
    "house": "reads the tree",
}


if __name__ == "__main__":
    machine_code = Path(sys.prefix) / "numba-generic"  # beside what this processor's own runs keep
    os.environ |= other_processor() | {"NUMBA_CACHE_DIR": str(machine_code), "RSO_LIDAR_QUICK_TEST_S": "inf"}
    chosen = [] if any(one.startswith("tests") for one in sys.argv[1:]) else [f"tests/{room}" for room in REPEATED]
    os.execv(sys.executable, [sys.executable, "-m", "pytest", *sys.argv[1:], *chosen])
