"""FMUs of the tests: the Reference FMUs of the Modelica Association, compiled here, and small ones in Python."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

# Sources of https://github.com/modelica/Reference-FMUs at 1258711a41e2, licence inside.
SOURCES = Path(__file__).parent / "data" / "reference_fmus.zip"
PLATFORMS = {2: "linux64", 3: "x86_64-linux"}
SECOND_ORDER = '''
import math
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

class SecondOrder(Fmi2Slave):
    """Both axes of a drive, solved exactly for a demand that is held over a step. In degrees, to try units."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.natural_hz = 2.0
        self.state = {"pan": [0.0, 0.0, 0.0], "tilt": [0.0, 0.0, 0.0]}  # demand, angle, rate
        self.register_variable(Real("natural_hz", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        for axis in self.state:
            for place, name in enumerate(("demand", "angle", "rate")):
                causality = Fmi2Causality.input if place == 0 else Fmi2Causality.output
                self._add(f"{axis}_{name}", axis, place, causality=causality, start=0.0 if place == 0 else None)
            self._add(f"{axis}_start", axis, 1, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)

    def _add(self, name, axis, place, **kind):
        def write(value):
            self.state[axis][place] = value
        self.register_variable(Real(name, getter=lambda: self.state[axis][place], setter=write, **kind))

    def do_step(self, time, step):
        w, z = 2.0 * math.pi * self.natural_hz, 0.7
        root, fading = w * math.sqrt((1.0 - z) * (1.0 + z)), math.exp(-z * w * step)
        c, q = math.cos(root * step), math.sin(root * step) / root
        for values in self.state.values():
            demand, angle, rate = values
            off = angle - demand
            values[1] = demand + fading * ((c + z * w * q) * off + q * rate)
            values[2] = fading * (-w * w * q * off + (c - z * w * q) * rate)
        return FAIL

    def _get_fmu_state(self):
        return {"state": {axis: list(values) for axis, values in self.state.items()}}

    def _set_fmu_state(self, saved):
        self.state.update({axis: list(values) for axis, values in saved["state"].items()})
'''

OSCILLATOR = '''
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Oscillator(Fmi2Slave):
    """An oscillator of 1 rad/s by explicit Euler steps of the length of the communication steps."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x, self.v = 1.0, 0.0
        for name in "xv":
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, time, step):
        self.x, self.v = self.x + step * self.v, self.v - step * self.x
        return True
'''


def compile_reference(folder, model, version):
    """Compile a Reference FMU and return its path; without a C compiler for this platform the test is skipped."""
    if shutil.which("cc") is None or sys.platform != "linux":
        pytest.skip("needs Linux and a C compiler as `cc`")
    sources = folder / "sources"
    if not sources.exists():
        with zipfile.ZipFile(SOURCES) as archive:
            archive.extractall(sources)
    library = folder / f"{model}{version}.so"
    command = ["cc", "-shared", "-fPIC", "-w", "-DDISABLE_PREFIX", f"-DFMI_VERSION={version}"]
    command += [f"-I{sources / 'include'}", f"-I{sources / model}", "-o", str(library)]
    command += [str(sources / "src" / name) for name in (f"fmi{version}Functions.c", "cosimulation.c")]
    subprocess.run([*command, str(sources / model / "model.c"), "-lm"], check=True)
    path = folder / f"{model}{version}.fmu"
    write_fmu(path, (sources / model / f"FMI{version}.xml").read_text(), library.read_bytes(), model, version)
    return path


def write_fmu(path, description, library, model, version=2):
    """Write an FMU of a description and a library."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr(f"binaries/{PLATFORMS[version]}/{model}.so", library)


def build_drive(folder, *, can_restore=True, fail="True"):
    """Build the second-order drive as an FMU by pythonfmu."""
    from pythonfmu import FmuBuilder

    source = folder / f"second_order_{can_restore}_{len(fail)}.py"
    source.write_text(SECOND_ORDER.replace("FAIL", fail))
    options = {"canGetAndSetFMUstate": can_restore, "canSerializeFMUstate": can_restore}
    built = FmuBuilder.build_FMU(source, dest=folder / f"{source.stem}.fmu", **options)
    return Path(built)


def build_oscillator(folder):
    """Build the oscillator as an FMU for co-simulation by pythonfmu."""
    from pythonfmu import FmuBuilder

    source = folder / "oscillator.py"
    source.write_text(OSCILLATOR)
    return Path(FmuBuilder.build_FMU(source, dest=folder / "oscillator.fmu"))
