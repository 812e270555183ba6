"""Matches of outputs to inputs by name, type and unit."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from orchestration.components.fmi.read_description import NUMERIC, Model, Variable
from orchestration.systems.system.conversion import BECOMES, Conversion, OtherQuantity, conversion

NOISE = frozenset(
    (
        *("in", "out", "input", "output", "u", "y", "signal", "value", "actual"),
        *("cmd", "command", "control", "meas", "measured", "measurement"),
    )
)
"""Words in a name that denote an end of a connection, not a quantity"""


@dataclass(frozen=True, kw_only=True)
class Match:
    """An output matched to an input."""

    start: str
    """COMPONENT.VARIABLE"""
    end: str
    conversion: Conversion
    why: str | None
    """the reason for the match; None: the same name"""


@dataclass(frozen=True, kw_only=True)
class Matches:
    """The matches, and messages on what could not be decided."""

    matches: tuple[Match, ...]
    undecided: tuple[str, ...]


@dataclass(frozen=True)
class _Port:
    component: str
    model: Model
    variable: Variable

    @property
    def place(self) -> str:
        return f"{self.component}.{self.variable.name}"

    @property
    def described(self) -> str:
        unit = f" [{self.variable.unit}]" if self.variable.unit else ""
        return f"{self.place} ({self.variable.kind}{unit})"

    @property
    def words(self) -> frozenset[str]:
        """The words of its name, without those that denote no quantity."""
        parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+", self.variable.name)
        return frozenset(part.lower() for part in parts) - NOISE


def match(models: Mapping[str, Model]) -> Matches:
    """Match each input of each component to an output of another, where only one fits.

    Names decide: the same name, else the same words, else the words of one name being among those of the other. Else
    the unit decides, if only one output and one input have it. Ports of the same name are matched first, and their
    outputs are no candidates for other inputs.
    """
    inputs = [port for name in models for port in _ports(name, models[name], "input")]
    outputs = [port for name in models for port in _ports(name, models[name], "output")]
    found: dict[str, Match] = {}
    undecided: dict[str, str] = {}
    used: set[str] = set()
    for why, fits in _RULES:
        open_inputs = [port for port in inputs if port.place not in found and port.place not in undecided]
        free = [port for port in outputs if port.place not in used]
        for port in open_inputs:
            others = [output for output in free if output.component != port.component]
            _decide(port, [o for o in others if fits(port, o, free, open_inputs)], why, found, undecided)
        used |= {m.start for m in found.values()}
    return Matches(
        matches=tuple(found[port.place] for port in inputs if port.place in found),
        undecided=(
            *(undecided[port.place] for port in inputs if port.place in undecided),
            *_unmatched([port for port in inputs if port.place not in found and port.place not in undecided]),
        ),
    )


def _unmatched(ports: Sequence[_Port]) -> list[str]:
    """A line for each component with inputs without a match."""
    lines = []
    for component in dict.fromkeys(port.component for port in ports):
        own = [
            port.described + ("" if port.variable.start is None else f" = {port.variable.start}")
            for port in ports
            if port.component == component
        ]
        lines.append(f"no output fits, so a start value is kept by {', '.join(own)}")
    return lines


def _ports(name: str, model: Model, causality: str) -> list[_Port]:
    return [_Port(name, model, model.variables[v]) for v in model.names(causality, kinds=NUMERIC)]


def _decide(
    port: _Port, candidates: Sequence[_Port], why: str | None, found: dict[str, Match], undecided: dict[str, str]
) -> None:
    """Match the one candidate whose type and unit fit, or note why there is none."""
    fitting: list[tuple[_Port, Conversion]] = []
    objections = []
    for candidate in candidates:
        if port.variable.kind not in BECOMES[candidate.variable.kind]:
            objections.append(f"{candidate.described} is of a type that does not become one")
            continue
        try:
            converted = conversion(candidate.model, candidate.variable, port.model, port.variable)
        except OtherQuantity:
            objections.append(f"{candidate.described} is of another quantity")
            continue
        if converted is None:
            objections.append(f"{candidate.described} is in another unit, which an FMU does not define")
            continue
        fitting.append((candidate, converted))
    if len(fitting) == 1:
        ((chosen, converted),) = fitting
        found[port.place] = Match(start=chosen.place, end=port.place, conversion=converted, why=why)
    elif fitting:
        names = ", ".join(candidate.place for candidate, _ in fitting)
        undecided[port.place] = f"{port.described} is not connected: it may be any of {names}"
    elif objections and why is None:
        undecided[port.place] = f"{port.described} is not connected: {'; '.join(objections)}"


def _same_name(port: _Port, output: _Port, outputs: Sequence[_Port], inputs: Sequence[_Port]) -> bool:
    return output.variable.name.lower() == port.variable.name.lower()


def _same_words(port: _Port, output: _Port, outputs: Sequence[_Port], inputs: Sequence[_Port]) -> bool:
    return bool(port.words) and output.words == port.words


def _some_words(port: _Port, output: _Port, outputs: Sequence[_Port], inputs: Sequence[_Port]) -> bool:
    one, other = output.words, port.words
    return bool(one and other) and (one <= other or other <= one)


def _only_one_of_its_unit(port: _Port, output: _Port, outputs: Sequence[_Port], inputs: Sequence[_Port]) -> bool:
    unit = port.variable.unit
    if not unit or output.variable.unit != unit:
        return False
    givers = [o for o in outputs if o.variable.unit == unit and o.component != port.component]
    takers = [i for i in inputs if i.variable.unit == unit and i.component != output.component]
    return len(givers) == len(takers) == 1


_RULES: tuple[tuple[str | None, Callable[[_Port, _Port, Sequence[_Port], Sequence[_Port]], bool]], ...] = (
    (None, _same_name),
    ("its name has the same words", _same_words),
    ("its name is alike", _some_words),
    ("nothing else has its unit", _only_one_of_its_unit),
)
"""The reasons for a match, the surest first, each with the test of an output, given the unmatched ports"""
