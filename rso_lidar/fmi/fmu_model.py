"""FMUs as parts: the file, the mapping of its variables, its parameters and steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import Field

from rso_lidar.errors import ScenarioError, did_you_mean
from rso_lidar.fmi.run import FmuRun, FmuSettings, Signal
from rso_lidar.fmi.unit_table import Conversion, find_conversion
from rso_lidar.part import Number, Part, Positive, Text

Mapped = Text | Number | tuple[Text | Number, ...]


class FmuModel(Part):
    """Base of parts that a Functional Mock-up Unit (FMI 2 or 3) computes.

    `inputs` and `outputs` map quantities of the package to names of variables of the FMU. A vector is a list of names, or
    the name of one array. A number in place of a name is a constant output. Units come from the FMU and are converted;
    `units` states those that it does not declare. The FMU runs native code, so a scenario that names one is flown only
    where it is trusted (`--trust-fmu`, or ``trust_fmu=True``).

    An FMU advances on a fixed grid from t = 0. One for co-simulation makes a step of its own from point to point; one for
    model exchange is integrated by a classical Runge-Kutta step of fourth order, and its events are found by bisection.
    """

    # Unit and number of elements of each quantity; 0 is any number. Those of `optional_names` may be left out.
    input_units: ClassVar[dict[str, tuple[str, int]]] = {}
    output_units: ClassVar[dict[str, tuple[str, int]]] = {}
    optional_names: ClassVar[frozenset[str]] = frozenset()
    preferred_interface: ClassVar[str] = "co_simulation"  # of an FMU that has both

    file: Text = Field(description="The FMU.")
    interface: Literal["co_simulation", "model_exchange"] | None = Field(
        default=None,
        description="Interface of the FMU to use. If omitted, that which the FMU has; of both, model exchange for a motion "
        "or an attitude, and co-simulation for a drive or a controller.",
    )
    inputs: dict[str, Text | tuple[Text, ...]] = Field(
        default={},
        description="Variables of the FMU that are set, by quantity: a name, or a list of names for a vector.",
    )
    outputs: dict[str, Mapped] = Field(
        default={}, description="Variables of the FMU that are read, by quantity; a number is a constant."
    )
    parameters: dict[str, Number] = Field(
        default={}, description="Start values of parameters and variables of the FMU by name, in its own units."
    )
    units: dict[str, Text] = Field(
        default={}, description="Units of variables for which the FMU declares none, such as `rad` or `m/s`."
    )
    relative_tolerance: Positive = Field(
        default=1e-6, description="Relative tolerance that a co-simulation FMU is given for its own integration."
    )

    def make_run(self, step_s: float) -> FmuRun:
        """Start a process for the FMU, and check the mapping against its variables.

        Parameters
        ----------
        step_s : grid of the run [s]

        Returns
        -------
        FmuRun
            Not yet initialised

        Raises
        ------
        ScenarioError
            If the FMU cannot be run, or the mapping does not fit it
        """
        path = Path(self.file)
        run = FmuRun(path)
        description = run.description
        interfaces = description["interfaces"]
        own = self.preferred_interface if self.preferred_interface in interfaces else next(iter(interfaces), "")
        interface = self.interface or own
        if interface not in interfaces:
            raise ScenarioError(
                f"{path.name}: the FMU has no interface {interface or 'that can be run'} (it has "
                f"{', '.join(interfaces) or 'none'}); choose another, or export it again"
            )
        variables = description["variables"]
        for name in (*self.parameters, *self.units):
            _check_variable(path.name, name, variables)
        for name in self.parameters:
            if variables[name]["elements"] != 1 or variables[name]["type"] in ("String", "Binary"):
                raise ScenarioError(f"{path.name}: '{name}' is not a number; leave it out of `parameters`")
        inputs = self._map(path.name, "inputs", self.inputs, self.input_units, description)
        outputs = self._map(path.name, "outputs", self.outputs, self.output_units, description)
        self._check_set_once(path.name, [signal.variable for signal in inputs])
        run.settings = FmuSettings(
            interface, step_s, self.relative_tolerance, tuple(self.parameters.items()), inputs, outputs
        )
        return run

    def _check_set_once(self, file: str, inputs: list[str | None]) -> None:
        """Refuse a variable that is set twice: one of the two values would be lost."""
        for place, name in enumerate(inputs):
            if name in inputs[:place]:
                raise ScenarioError(f"{file}: '{name}' is mapped twice in `inputs`; map each variable once")
            if name in self.parameters:
                raise ScenarioError(
                    f"{file}: '{name}' is among `inputs` and `parameters`; leave it out of `parameters`, as its first value "
                    "comes from its quantity"
                )

    def _map(
        self,
        file: str,
        place: str,
        mapping: dict[str, Mapped] | dict[str, str | tuple[str, ...]],
        known: dict[str, tuple[str, int]],
        description: dict[str, Any],
    ) -> tuple[Signal, ...]:
        """Return the signals of a mapping, in the order of the quantities.

        Parameters
        ----------
        known : unit and number of elements of each quantity
        """
        for name in mapping:
            if name not in known:
                raise ScenarioError(
                    f"{place}: no quantity '{name}'{did_you_mean(name, known)} (known: {', '.join(known) or 'none'})"
                )
        signals: list[Signal] = []
        for quantity, (unit, count) in known.items():
            if quantity not in mapping:
                if quantity in self.optional_names:
                    continue
                raise ScenarioError(f"{place}: '{quantity}' is missing; name the variable of the FMU for it [{unit}]")
            given = mapping[quantity]
            entries = given if isinstance(given, tuple) else (given,)
            n_elements = 0
            for entry in entries:
                if not isinstance(entry, str):
                    signals.append(Signal(quantity, None, 1, Conversion(0.0, float(entry))))
                    n_elements += 1
                    continue
                _check_variable(file, entry, description["variables"])
                variable = description["variables"][entry]
                where = f"{file}: '{entry}'"
                wanted = "input" if place == "inputs" else "output"
                if place == "inputs" and variable["causality"] != "input":
                    raise ScenarioError(f"{where} is of causality {variable['causality']}, not {wanted}; name another")
                if variable["type"] in ("String", "Binary", "Clock"):
                    raise ScenarioError(f"{where} is a {variable['type']}, not a number; name another")
                conversion = find_conversion(where, variable["unit"], self.units.get(entry), description["units"], unit)
                signals.append(Signal(quantity, entry, variable["elements"], conversion))
                n_elements += variable["elements"]
            if count and n_elements != count:
                raise ScenarioError(
                    f"{place}: '{quantity}' has {count} elements, and {n_elements} are given; correct them"
                )
        return tuple(signals)


def _check_variable(file: str, name: str, variables: dict[str, Any]) -> None:
    """Refuse the name of a variable that the FMU does not have."""
    if name not in variables:
        raise ScenarioError(f"{file}: the FMU has no variable '{name}'{did_you_mean(name, variables) or '; check it'}")
