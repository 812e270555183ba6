"""FMUs for model exchange and in event mode, all of one C source, compiled once where the tests run."""

import functools
import subprocess
import tempfile
import zipfile
from pathlib import Path

import fmpy

from tests.orchestration.components.fmi.small import COMPILER

_SOURCE = Path(__file__).with_name("exchange.c")
_STATES = {"integrator": 2, "ball": 2, "oscillator": 2, "restless": 2}
_CROSSINGS = {"ball": 1, "restless": 1}

_FMI3 = """<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{guid}">
  {interfaces}
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent"/>
    <Float64 name="x1" valueReference="1" causality="output"/>
    <Float64 name="x2" valueReference="2" causality="output"/>
    <Float64 name="dx1" valueReference="3" derivative="1"/>
    <Float64 name="dx2" valueReference="4" derivative="2"/>
    <Float64 name="u" valueReference="5" causality="input" start="0"/>
    <Float64 name="w" valueReference="6" causality="input" start="0"/>
    <Float64 name="p" valueReference="7" causality="parameter" variability="tunable" start="{p}"/>
    <Float64 name="q" valueReference="8" causality="parameter" variability="tunable" start="0"/>
    <Float64 name="start" valueReference="10" causality="parameter" variability="fixed" start="{start}"/>
    <Float64 name="y" valueReference="9" causality="output"/>
    <Int32 name="count" valueReference="20" causality="output"/>
    <Int32 name="updates" valueReference="21" causality="output"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1"/><Output valueReference="2"/><Output valueReference="9"/>{states}
    <InitialUnknown valueReference="1" dependencies=""/>
    <InitialUnknown valueReference="9" dependencies="{feeds}"/>
  </ModelStructure>
</fmiModelDescription>"""

_CLOCKED = """<fmiModelDescription fmiVersion="3.0" modelName="Law" instantiationToken="law">
  <CoSimulation modelIdentifier="law" canGetAndSetFMUState="true" canSerializeFMUState="true" hasEventMode="true"
    canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <Float64 name="u" valueReference="5" causality="input" variability="discrete" clocks="30" start="0"/>
    <Float64 name="w" valueReference="6" causality="input" variability="discrete" clocks="30" start="0"/>
    <Float64 name="p" valueReference="7" causality="parameter" variability="fixed" start="-1"/>
    <Float64 name="q" valueReference="8" causality="parameter" variability="fixed" start="-1"/>
    <Float64 name="y" valueReference="9" causality="output" variability="discrete" clocks="30" start="0"/>
    <Float64 name="period" valueReference="11" causality="output"/>
    <Int32 name="misused" valueReference="22" causality="output"/>
    <Int32 name="ticks" valueReference="23" causality="output"/>
    <Int32 name="slow_ticks" valueReference="24" causality="output"/>
    {clocks}
  </ModelVariables>
  <ModelStructure><Output valueReference="9"/></ModelStructure>
</fmiModelDescription>"""
_CLOCKS = """<fmiModelDescription fmiVersion="3.0" modelName="Clocks" instantiationToken="clocks">
  <ScheduledExecution modelIdentifier="clocks" canGetAndSetFMUState="true" canSerializeFMUState="true"/>
  <ModelVariables>
    <Float64 name="u" valueReference="5" causality="input" variability="discrete" clocks="30 31" start="0"/>
    <Float64 name="y" valueReference="9" causality="output" variability="discrete" clocks="30 31 32" start="0"/>
    <Float64 name="w" valueReference="6" causality="input" variability="discrete" clocks="30" start="0"/>
    <Float64 name="p" valueReference="7" causality="parameter" variability="fixed" start="1"/>
    <Int32 name="jobs1" valueReference="40" causality="output" clocks="30"/>
    <Int32 name="jobs2" valueReference="41" causality="output" clocks="31"/>
    <Int32 name="jobs3" valueReference="42" causality="output" clocks="32"/>
    <Int32 name="total" valueReference="43" causality="output" clocks="30 31 32"/>
    {clocks}
  </ModelVariables>
  <ModelStructure><Output valueReference="9"/></ModelStructure>
</fmiModelDescription>"""
_FAST = '<Clock name="{name}" valueReference="{reference}" causality="input" intervalVariability="{kind}" {interval}/>'

_FMI2 = """<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{guid}" numberOfEventIndicators="{crossings}">
  {interfaces}
  <ModelVariables>
    <ScalarVariable name="x1" valueReference="1" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="x2" valueReference="2" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="dx1" valueReference="3"><Real derivative="1"/></ScalarVariable>
    <ScalarVariable name="dx2" valueReference="4"><Real derivative="2"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="5" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="w" valueReference="6" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="p" valueReference="7" causality="parameter" variability="tunable"><Real start="{p}"/>
    </ScalarVariable>
    <ScalarVariable name="q" valueReference="8" causality="parameter" variability="tunable"><Real start="0"/>
    </ScalarVariable>
    <ScalarVariable name="y" valueReference="9" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="start" valueReference="10" causality="parameter" variability="fixed"><Real start="{start}"/>
    </ScalarVariable>
    <ScalarVariable name="count" valueReference="20" causality="output" variability="discrete"><Integer/>
    </ScalarVariable>
    <ScalarVariable name="updates" valueReference="21" causality="output" variability="discrete"><Integer/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1"/><Unknown index="2"/><Unknown index="9"/></Outputs>{states}
    <InitialUnknowns><Unknown index="1" dependencies=""/><Unknown index="9" dependencies="{feeds}"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>"""


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


@functools.cache
def _library() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "exchange"
        options = ("-shared", "-fPIC", "-O1", "-w")
        subprocess.run([str(COMPILER), *options, str(_SOURCE), "-o", str(library), "-lm"], check=True)
        return library.read_bytes()
