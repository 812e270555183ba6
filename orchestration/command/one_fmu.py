"""The flags of a run of one FMU."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

from orchestration.command.flags import FlightFlags, assigned
from orchestration.command.options import option
from orchestration.command.registry import expect_positive
from orchestration.components.fmi.access import INTERFACES, SCHEDULED, SOLVERS
from orchestration.foundation.basics.errors import SimulatorError, UsageError, expected_name
from orchestration.foundation.basics.terminal import inform, warn

if TYPE_CHECKING:
    from orchestration.simulation.runs.result import Result
    from orchestration.systems.system.model import System

Choice = TypeVar("Choice", bound=str)

_of_fmu = partial(option, panel="One FMU")
_ALONE = tuple(name for name in INTERFACES if name != SCHEDULED)
"""Interfaces by which one component is a whole FMU"""


@dataclass(frozen=True, kw_only=True)
class OneFmuFlags:
    """The flags that only a run of one FMU has; None: not set, its default experiment applies."""

    inputs: Annotated[Path | None, _of_fmu("--inputs", "Inputs over time, a column for each.", "FILE.csv")] = None
    start_time: Annotated[float | None, _of_fmu("--start-time", "Its own time at which the run begins.", "SECONDS")] = (
        None
    )
    output: Annotated[Path | None, _of_fmu("--output", "Write the outputs as fmpy does.", "FILE.csv")] = None
    output_interval: Annotated[
        float | None, _of_fmu("--output-interval", "Distance of rows, and communication step.", "SECONDS")
    ] = None
    tolerance: Annotated[
        float | None,
        _of_fmu(
            "--tolerance",
            "Relative tolerance of its solver; default: its experiment's, by model exchange else 1e-6. The "
            "absolute one is that times the nominal value of a state.",
            "R",
        ),
    ] = None
    solver: Annotated[
        str | None, _of_fmu("--solver", "By model exchange; default: dormand-prince.", "|".join(SOLVERS))
    ] = None
    record: Annotated[
        list[str] | None, _of_fmu("--record", "A variable to write; may be repeated; default: all outputs.", "NAME")
    ] = None

    interface: Annotated[
        str | None, _of_fmu("--interface", "By which it is called; default: co-simulation.", "|".join(_ALONE))
    ] = None

    def __post_init__(self) -> None:
        expect_positive("--output-interval", self.output_interval, "seconds")
        expect_positive("--tolerance", self.tolerance, "relative error")

    def expect_none(self) -> None:
        """Raise `UsageError` for any of them: what runs is not one FMU."""
        given = [f"--{f.name.replace('_', '-')}" for f in fields(self) if getattr(self, f.name) is not None]
        if given:
            raise UsageError(f"{', '.join(given)}: for one FMU only; expected run MODEL.fmu")

    def applied_to(self, path: Path, flags: FlightFlags) -> "System":
        """The FMU at `path` alone, with these flags and those of any system; `--set` has the names of the FMU."""
        from orchestration.components.fmi.read_description import read_model
        from orchestration.simulation.requests.one_fmu import alone, late_jump, outputs, remarks

        solver = _chosen("solver", self.solver, SOLVERS)
        interface = _chosen("interface", self.interface, _ALONE) or ("model-exchange" if solver else None)
        system = alone(
            path, start_time=self.start_time, stop_time=flags.stop_time, interval=self.output_interval,
            tolerance=self.tolerance, inputs=self.inputs, record=self.record or (),
            parameters=assigned("set", flags.set), interface=interface, solver=solver,
        )  # fmt: skip
        if self.output is not None and not self.record and not outputs(read_model(path)):
            raise UsageError(f"--output: {path} has no outputs to write: expected --record NAME")
        for remark in remarks(system, is_default_end=flags.stop_time is None):
            inform(remark)
        if late := late_jump(system):
            warn(f"{self.inputs}: {late}")
        return replace(flags, stop_time=None, set=None).applied_to_system(system)

    @contextmanager
    def rows_kept(self, path: Path | None) -> Iterator[None]:
        """Write the file of `--output` also where the FMU at `path` ends the run in the block, and say so."""
        try:
            yield
        except SimulatorError as ended:
            if path is not None and self.output is not None and ended.result is not None:
                self.write(path, ended.result)
                ended.args = (f"{ended}; the rows until then are in {self.output}",)
            raise

    def write(self, path: Path, result: "Result") -> None:
        """Write the file of `--output`, of a run of the FMU at `path`."""
        from orchestration.components.fmi.read_description import read_model
        from orchestration.simulation.requests.one_fmu import outputs
        from orchestration.simulation.runs import fmpy_table

        if self.output is not None:
            model, (component,) = read_model(path), result.system.components.values()
            chosen = (component.record or ()) if self.record else outputs(model)
            fmpy_table.write(result, model, chosen, self.output)


def _chosen(flag: str, name: str | None, known: Sequence[Choice]) -> Choice | None:
    """One of the names that a flag takes; raises `UsageError` for another one."""
    if name is None:
        return None
    for each in known:
        if each == name:
            return each
    raise UsageError(f"--{flag} {name}: {expected_name(name, list(known))}")
