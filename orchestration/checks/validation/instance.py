"""An instance of an FMU under validation, by plain FMI calls; any variable type, any order of calls."""

import struct
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from fmpy import fmi2
from fmpy.fmi1 import FMICallException

from orchestration.basics.errors import QuadcosimError
from orchestration.checks.validation.fmu import Fmu, Variable
from orchestration.fmi.messages import Message, words
from orchestration.fmi.slaves import instantiate, loaded

Value: TypeAlias = float | int | bool | str
Values: TypeAlias = Mapping[str, Value]
Row: TypeAlias = dict[str, Value]
"""Values by the names of the variables"""

_ACCESS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean", "String": "String"}
_CONVERT: dict[str, Callable[[Any], Value]] = {
    "Real": float, "Integer": int, "Boolean": bool, "String": lambda text: (text or b"").decode("utf-8", "replace")
}  # fmt: skip


class RefusedError(QuadcosimError):
    """The FMU did not carry out a call; the text names the call and has the FMU's own words."""


class Instance:
    """One instance; after a call that failed it is never called again, not even to free it."""

    def __init__(self, fmu: Fmu, folder: Path, name: str, beat: Callable[[], None]) -> None:
        self.fmu = fmu
        self.messages: list[Message] = []
        self._variables = {v.name: v for v in fmu.variables}
        self._failed = True
        self._beat = beat
        beat()
        try:
            self._slave = loaded(2, folder, token=fmu.guid, identifier=fmu.model_identifier, name=name)
            instantiate(self._slave, self.messages)
        except Exception as error:
            raise RefusedError(f"fmi2Instantiate: {words(self.messages, str(error))[0]}") from error
        beat()
        self._failed = False

    def __enter__(self) -> "Instance":
        return self

    def __exit__(self, *exception: object) -> None:
        if not self._failed:
            self._failed = True
            self._slave.freeInstance()

    # -- a run ----------------------------------------------------------------------------------------------

    def begin(self, values: Values, start: float, stop: float | None = None) -> None:
        """Set parameters, enter initialisation mode, set inputs; `stop` is None if no stop time is defined."""
        inputs = {name: value for name, value in values.items() if self._variables[name].causality == "input"}
        self.set({name: value for name, value in values.items() if name not in inputs})
        self._call("setupExperiment", startTime=start, stopTime=stop)
        self._call("enterInitializationMode")
        self.set(inputs)

    def initialise(self, values: Values, start: float, stop: float | None = None) -> None:
        """Through initialisation."""
        self.begin(values, start, stop)
        self._call("exitInitializationMode")

    def step(self, t: float, h: float) -> bool:
        """From `t` to `t + h` seconds; whether the run goes on, for an FMU may say that it ends it here."""
        if self._failed:
            raise RefusedError("fmi2DoStep: the instance has failed and is not called again")
        self._beat()
        try:
            self._slave.doStep(currentCommunicationPoint=t, communicationStepSize=h)
        except FMICallException as error:
            if error.status == fmi2.fmi2Discard and self._call("getBooleanStatus", fmi2.fmi2Terminated):
                return False
            raise self._refusal(error) from None
        self._beat()
        return True

    def terminate(self) -> None:
        """End the run."""
        self._call("terminate")

    def reset(self) -> None:
        """Back to the state after instantiation."""
        self._call("reset")

    # -- values ---------------------------------------------------------------------------------------------

    def set(self, values: Values) -> None:
        """Set variables by name."""
        for name, value in values.items():
            variable = self._variables[name]
            self._call(f"set{_ACCESS[variable.type]}", [variable.reference], [value])

    def get(self, variables: Iterable[Variable]) -> Row:
        """The values of variables, asked for by type."""
        by_access: dict[str, list[Variable]] = {}
        for v in variables:
            by_access.setdefault(_ACCESS[v.type], []).append(v)
        row: Row = {}
        for access, group in by_access.items():
            values = self._call(f"get{access}", [v.reference for v in group])
            row.update((v.name, _CONVERT[access](x)) for v, x in zip(group, values))
        return row

    # -- state ----------------------------------------------------------------------------------------------

    def state(self) -> Any:
        """A copy of the state, to be given back to `put_back` or `serialised` of this instance."""
        return self._call("getFMUstate")

    def put_back(self, state: Any) -> None:
        """Go on from a state, and free it."""
        self._call("setFMUstate", state)
        self._call("freeFMUstate", state)

    def serialised(self) -> bytes:
        """The state as bytes."""
        state = self._call("getFMUstate")
        content = bytes(self._call("serializeFMUstate", state))
        self._call("freeFMUstate", state)
        return content

    def put_back_bytes(self, content: bytes) -> None:
        """Go on from what `serialised` of any instance of the FMU gave."""
        self.put_back(self._call("deSerializeFMUstate", content))

    # -- inside ---------------------------------------------------------------------------------------------

    def _call(self, method: str, *args: Any, **kwargs: Any) -> Any:
        if self._failed:
            raise RefusedError(f"{method}: the instance has failed and is not called again")
        self._beat()
        try:
            return getattr(self._slave, method)(*args, **kwargs)
        except FMICallException as error:
            raise self._refusal(error) from None
        finally:
            self._beat()

    def _refusal(self, error: FMICallException) -> RefusedError:
        self._failed = True
        return RefusedError(f"{error.function}: {words(self.messages, f'status {error.status}')[0]}")


def same(a: Value, b: Value) -> bool:
    """Whether two values have the same bits."""
    if isinstance(a, float) and isinstance(b, float):
        return struct.pack("d", a) == struct.pack("d", b)
    return a == b
