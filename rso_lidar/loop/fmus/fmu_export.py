"""Simulations written as FMUs for co-simulation, FMI 2 and 3, by pythonfmu and pythonfmu3."""

from __future__ import annotations

import hashlib
import importlib
import shutil
import tempfile
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from rso_lidar.errors import ScenarioError
from rso_lidar.files import check_writable, write_atomically
from rso_lidar.loop.fmus.instrument import OUTPUTS, Port, list_inputs
from rso_lidar.scenario import Scenario, list_named_files

FMU_SUFFIXES = (".fmu",)
VERSIONS = (2, 3)
_PACKAGES = {2: "pythonfmu", 3: "pythonfmu3"}
_BASE_UNITS = {"m": {"m": "1"}, "s": {"s": "1"}, "rad": {"rad": "1"}}

# The slave of both versions: pythonfmu instantiates it to write the description, and the FMU to run.
_SLAVE = '''"""An instrument of rso_lidar as an FMU. It needs the Python, and the rso_lidar, of the machine that runs it."""
import pickle
from pathlib import Path

from {package} import {imports}
from rso_lidar.loop.fmus.instrument import Instrument

INPUTS = {inputs!r}
OUTPUTS = {outputs!r}


class Lidar({bases}):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.folder, self.instrument = Path(kwargs["resources"]), None
        self.inputs = {{name: start for name, start, *_ in INPUTS}}
        self.outputs = {{name: start for name, start, *_ in OUTPUTS}}
        {extra}
        for values, ports, causality in (
            (self.inputs, INPUTS, {causality}.input), (self.outputs, OUTPUTS, {causality}.output)
        ):
            for name, start, meaning, is_whole in ports:
                self._register(values, name, start, meaning, is_whole, causality)

    def _register(self, values, name, start, meaning, is_whole, causality):
        def read():
            return (int if is_whole else float)(values[name])

        def write(value):
            values[name] = value

        given = {{"start": (int if is_whole else float)(start)}} if values is self.inputs else {{}}
        kind, variability = ({whole}, {variability}.discrete) if is_whole else ({real}, {variability}.continuous)
        self.register_variable(
            kind(name, causality=causality, variability=variability, description=meaning, getter=read, setter=write, **given)
        )

    def _get_fmu_state(self):
        held = None if self.instrument is None else self.instrument.save()
        return {{"inputs": dict(self.inputs), "outputs": dict(self.outputs), "instrument": held}}

    def _set_fmu_state(self, state):
        self.inputs.update(state["inputs"])
        self.outputs.update(state["outputs"])
        if state["instrument"] is None:
            self.instrument = None
        else:
            self.instrument = self.instrument or Instrument.load(self.folder)
            self.instrument.restore(state["instrument"])

    @staticmethod
    def _fmu_state_to_bytes(state):
        return pickle.dumps(state)

    @staticmethod
    def _fmu_state_from_bytes(state):
        return pickle.loads(state)

    def exit_initialization_mode(self):
        self.instrument = Instrument.load(self.folder)
        self._advance(0.0)

    def do_step(self, current_time, step_size):
        self._advance(current_time + step_size)
        return {done}

    def _advance(self, until_s):
        self.instrument.inputs.update(self.inputs)
        self.instrument.advance(until_s)
        self.outputs.update(self.instrument.outputs)
'''
_WORDS = {
    2: {
        "imports": "Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real",
        "bases": "Fmi2Slave",
        "extra": "",
        "causality": "Fmi2Causality",
        "variability": "Fmi2Variability",
        "whole": "Integer",
        "real": "Real",
        "done": "True",
    },
    3: {
        "imports": "CoSimulation, Float64, Fmi3Causality, Fmi3Slave, Fmi3Status, Fmi3StepResult, Fmi3Variability, Int32",
        "bases": "Fmi3Slave, CoSimulation",
        "extra": "self.time = 0.0\n"
        '        self.register_variable(Float64("time", causality=Fmi3Causality.independent, '
        "variability=Fmi3Variability.continuous))",
        "causality": "Fmi3Causality",
        "variability": "Fmi3Variability",
        "whole": "Int32",
        "real": "Float64",
        "done": "Fmi3StepResult(status=Fmi3Status.ok)",
    },
}


def write_fmu(scenario: Scenario, path: str | Path, *, version: int = 2, overwrite: bool = False) -> Path:
    """Write the instrument of a scenario as an FMU for co-simulation.

    The FMU holds the scenario and the files that it names. It runs in the Python of the machine, which needs rso_lidar.

    Parameters
    ----------
    scenario : to be flown, without Python objects
    path : of the FMU (.fmu)
    version : of FMI, 2 or 3
    overwrite : whether a file that exists is replaced

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    ScenarioError
        If the scenario cannot be flown from its text, or the package that writes FMUs is not installed.
    """
    place = check_writable(path, FMU_SUFFIXES, overwrite=overwrite)
    if version not in VERSIONS:
        raise ScenarioError(f"version: {version!r:.40} is no version of FMI that can be written; give 2 or 3")
    builder = _import_builder(version)
    inputs = list_inputs(scenario)
    words = {"package": _PACKAGES[version], "inputs": _list_ports(inputs), "outputs": _list_ports(OUTPUTS)}
    with tempfile.TemporaryDirectory(prefix="rso_lidar_fmu_") as folder_name:
        folder = Path(folder_name)
        resources = [folder / "scenario.toml", *_copy_files(scenario, folder)]
        resources[0].write_text(scenario.source.scenario, encoding="utf-8")
        # A process imports a module once by its name, and may run several of these FMUs.
        mark = hashlib.sha256(f"{version}{scenario.source.scenario}".encode()).hexdigest()[:12]
        script = folder / f"lidar_{mark}.py"
        script.write_text(_SLAVE.format(**words, **_WORDS[version]), encoding="utf-8")
        options = {"canHandleVariableCommunicationStepSize": True, "needsExecutionTool": True}
        word = "FMUstate" if version == 2 else "FMUState"
        options |= {f"canGetAndSet{word}": True, f"canSerialize{word}": True}
        written = folder / "written"
        written.mkdir()
        try:
            built = Path(builder.build_FMU(script, dest=written, project_files=resources, **options))
        except TypeError:  # pythonfmu3 returns nothing
            built = next(written.glob("*.fmu"))
        with write_atomically(place) as draft:
            _state_units(built, Path(draft), {port.name: port.unit for port in (*inputs, *OUTPUTS)})
    return place


def _import_builder(version: int) -> Any:
    """Return the class that builds FMUs of a version."""
    package = _PACKAGES[version]
    try:
        return importlib.import_module(package).FmuBuilder
    except ImportError:
        raise ScenarioError(
            f"writing an FMU of FMI {version} needs {package}; install it with: pip install rso-lidar[fmi]"
        ) from None


def _list_ports(ports: Iterable[Port]) -> list[tuple[str, float, str, bool]]:
    return [(port.name, port.start, port.meaning, port.is_whole) for port in ports]


def _copy_files(scenario: Scenario, folder: Path) -> list[Path]:
    """Copy the files that a scenario names by relative paths; return the files and folders to put into the FMU."""
    tops = []
    for name in list_named_files(Scenario.loads(scenario.source.scenario, trust_code=True)):
        wanted, _, _ = name.partition(":") if ".py:" in name else (name, "", "")
        if Path(wanted).is_absolute() or ".." in Path(wanted).parts:
            raise ScenarioError(
                f"{wanted}: is not below the scenario's folder, so it cannot go into an FMU; move it there"
            )
        target = folder / wanted
        target.parent.mkdir(parents=True, exist_ok=True)
        if not target.exists():
            shutil.copy2(scenario.file(wanted), target)
            top = folder / Path(wanted).parts[0]
            if top not in tops:
                tops.append(top)
    return tops


def _state_units(built: Path, final: Path, units: dict[str, str]) -> None:
    """Copy an FMU, and state the units of its variables in its description."""
    with zipfile.ZipFile(built) as before, zipfile.ZipFile(final, "w", zipfile.ZIP_DEFLATED) as after:
        for entry in before.infolist():
            data = before.read(entry)
            if entry.filename == "modelDescription.xml":
                data = _add_units(data, units)
            after.writestr(entry.filename, data)


def _add_units(description: bytes, units: dict[str, str]) -> bytes:
    root = ElementTree.fromstring(description)
    variables = root.find("ModelVariables")
    assert variables is not None
    for variable in variables:
        unit = units.get(variable.get("name", ""))
        real = variable if variable.tag == "Float64" else variable.find("Real")
        if unit in _BASE_UNITS and real is not None:
            real.set("unit", unit)
    structure, outputs = root.find("ModelStructure"), root.find("ModelStructure/Outputs")
    if structure is not None and outputs is not None:  # FMI 2; pythonfmu leaves out what is unknown at the start
        ElementTree.SubElement(structure, "InitialUnknowns").extend(list(outputs))
    definitions = ElementTree.Element("UnitDefinitions")
    for name, exponents in _BASE_UNITS.items():
        ElementTree.SubElement(ElementTree.SubElement(definitions, "Unit", name=name), "BaseUnit", exponents)
    place = [child.tag for child in root].index("CoSimulation") + 1
    root.insert(place, definitions)
    xml_bytes: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return xml_bytes
