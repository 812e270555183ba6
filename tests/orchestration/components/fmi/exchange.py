"""FMUs for model exchange and in event mode, all of one C source, compiled once where the tests run."""

import zipfile
from pathlib import Path

import fmpy

from tests.native import library
from tests.orchestration.components.fmi.small import COMPILER

_SOURCE = Path(__file__).with_name("exchange.c")
_STATES = {"integrator": 2, "ball": 2, "oscillator": 2, "restless": 2}
_CROSSINGS = {"ball": 1, "restless": 1}

_FMI3 = Path(__file__).with_name("exchange3.xml").read_text(encoding="utf-8")

_CLOCKED = Path(__file__).with_name("clocked.xml").read_text(encoding="utf-8")
_CLOCKS = Path(__file__).with_name("clocks.xml").read_text(encoding="utf-8")
_FAST = '<Clock name="{name}" valueReference="{reference}" causality="input" intervalVariability="{kind}" {interval}/>'

_FMI2 = Path(__file__).with_name("exchange2.xml").read_text(encoding="utf-8")


def exchange(folder: Path, kind: str, *, fmi: int = 3, event_mode: bool = False, slopes: bool = False) -> Path:
    """The FMU of a model of `exchange.c` in `folder`, for model exchange, or with `event_mode` for co-simulation.

    `slopes`: it offers directional derivatives.
    """
    path = folder / f"{kind}{fmi}{'_events' if event_mode else ''}{'_slopes' if slopes else ''}.fmu"
    flags = "State" if fmi == 3 else "state"
    saves = f'canGetAndSetFMU{flags}="true" canSerializeFMU{flags}="true"'
    if event_mode:
        more = 'canHandleVariableCommunicationStepSize="true" hasEventMode="true"'
        interfaces = f'<CoSimulation modelIdentifier="{kind}" {saves} {more}/>'
    else:
        derivatives = f"providesDirectionalDerivative{'s' if fmi == 3 else ''}"
        interfaces = f'<ModelExchange modelIdentifier="{kind}" {saves} {derivatives}="{str(slopes).lower()}"/>'
    crossings, has_states = _CROSSINGS.get(kind, 0), kind in _STATES
    if fmi == 3:
        states = '\n    <ContinuousStateDerivative valueReference="3"/><ContinuousStateDerivative valueReference="4"/>'
        states = states * has_states + '<EventIndicator valueReference="1"/>' * crossings
    else:
        states = '<Derivatives><Unknown index="3"/><Unknown index="4"/></Derivatives>' * has_states
    feeds = "5 6" if kind in ("gain", "curve") else ""
    text = (_FMI3 if fmi == 3 else _FMI2).format(
        name=kind.capitalize(), guid=kind, interfaces=interfaces, states=states, crossings=crossings, feeds=feeds,
        start=2 if kind == "oscillator" else 1, p=0.7 if kind == "ball" else 1,
    )  # fmt: skip
    place = fmpy.platform_tuple if fmi == 3 else fmpy.platform
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.writestr(f"binaries/{place}/{kind}{fmpy.sharedLibraryExtension}", _library())
    return path


def clock(name: str, kind: str = "constant", interval: str = 'intervalDecimal="0.5"', reference: int = 30) -> str:
    """An input clock of a law."""
    return _FAST.format(name=name, kind=kind, interval=interval, reference=reference)


def law(folder: Path, *clocks: str) -> Path:
    """The controller y = -u - w of `exchange.c`, clocked by the first of these clocks."""
    return _with_clocks(folder, "law", _CLOCKED.format(clocks="".join(clocks)))


def partitions(folder: Path, *more: str) -> Path:
    """Three partitions of `exchange.c`, which count their jobs; `more` are other clocks."""
    kinds = ("constant", "tunable", "fixed")
    intervals = ('intervalDecimal="1"', 'intervalDecimal="2.5"', "")
    own = (clock(f"inClock{i + 1}", kinds[i], intervals[i], 30 + i) for i in range(3))
    return _with_clocks(folder, "clocks", _CLOCKS.format(clocks="".join((*own, *more))))


def _with_clocks(folder: Path, name: str, description: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr(f"binaries/{fmpy.platform_tuple}/{name}{fmpy.sharedLibraryExtension}", _library())
    return path


def _library() -> bytes:
    return library(str(COMPILER), _SOURCE)
