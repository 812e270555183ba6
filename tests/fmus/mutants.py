"""FMUs of this project, each damaged in one way; `python -m tests.fmus.mutants` prints who notices.

Those of FMI 2.0 have Python inside, which is damaged; those of FMI 3.0 a library that commits a fault (`faulty_3.c`).
Each mutant but those of the GUID itself has the GUID of its own content, so that this one rule cannot do the work
of all the others.
"""

import sys
import tempfile
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import fmpy

from fmu_kit.archive import ICONS
from orchestration.components.building import builder
from orchestration.components.building.models import MODELS
from tests.fmus.damage import (
    DESCRIPTION,
    Damage,
    Files,
    Mutant,
    depends,
    description,
    element,
    entry,
    every,
    file,
    found,
    handle_of,
    put,
    replaced,
    root,
    source,
    unit,
    unknown,
    variable,
    without,
    without_unknown,
)
from tests.fmus.faulty import fault, faulty
from tests.fmus.stepped_from_outside import BALL, JOBS, LAW, stepped_from_outside
from tests.fmus.verdicts import Verdict, as_markdown, verdicts

PLANT, CONTROLLER = "QuadrotorPlant", "UnifiedController"


def _nothing(files: Files) -> None:
    """Damage that is done to the archive instead."""


# -- damage that takes more than an attribute -----------------------------------------------------------


def _truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-2000])


def _flip_a_byte(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[content.index(b"fmiVersion=")] ^= 1
    path.write_bytes(content)


def _add_a_second_entry(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content.replace(b"resources/second", b"resources/first."))


def _no_description(files: Files) -> None:
    files["modeldescription.xml"] = files.pop(DESCRIPTION)


def _swap(key: str, first: str, second: str) -> Damage:
    """Swap an attribute of two variables."""

    def change(root: Element) -> None:
        a, b = (found(root, f"ModelVariables/*[@name='{name}']") for name in (first, second))
        mine, theirs = a.get(key, ""), b.get(key, "")
        a.set(key, theirs)
        b.set(key, mine)

    return description(change)


def _drop_dependency(output: str, dropped: str) -> Damage:
    def change(root: Element) -> None:
        listed = entry(root, "InitialUnknowns", output)
        kept = [handle for handle in listed.get("dependencies", "").split() if handle != handle_of(root, dropped)]
        listed.set("dependencies", " ".join(kept))

    return description(change)


def _without_base_unit(name: str) -> Damage:
    def change(root: Element) -> None:
        defined = found(root, f"UnitDefinitions/Unit[@name='{name}']")
        defined.remove(found(defined, "BaseUnit"))

    return description(change)


def _retype(name: str, kind: str, type: str) -> Damage:
    """Another type, `type` in FMI 3.0."""

    def change(root: Element) -> None:
        declared = found(root, f"ModelVariables/*[@name='{name}']")
        if declared.tag == "ScalarVariable":
            declared[0].tag = kind
        else:
            declared.tag = type

    return description(change)


_GUID = "a1b2c3d4-0000-4000-8000-000000000000"


def _dimension(name: str, start: str | None = None, of: str | None = None) -> Damage:
    """It is an array of FMI 3.0: with so many elements, or with as many as another variable says."""

    def change(root: Element) -> None:
        dimension = SubElement(found(root, f"ModelVariables/*[@name='{name}']"), "Dimension")
        put(dimension, {"start": start} if of is None else {"valueReference": handle_of(root, of)})

    return description(change)


_BUILD = "sources/buildDescription.xml"
"""What FMI 3.0 has of sources to be compiled"""


def _compiled_of(name: str) -> Damage:
    """The FMU of FMI 2.0 says to be compiled of a file."""

    def change(root: Element) -> None:
        SubElement(SubElement(found(root, "CoSimulation"), "SourceFiles"), "File", name=name)

    return description(change)


_HERE = f"binaries/{fmpy.platform}/", f"binaries/{fmpy.platform_tuple}/"
"""In FMI 2.0 and 3.0"""


# -- the mutants ----------------------------------------------------------------------------------------

ARCHIVE = (
    Mutant(name="archive cut short", rule="readable", words=("zip archive",), damage=_nothing, rewrite=_truncate),
    Mutant(name="byte flipped", rule="readable", words=("CRC",), damage=_nothing, rewrite=_flip_a_byte),
    Mutant(
        name="no description", rule="readable", words=(DESCRIPTION,), damage=_no_description, keeps_guid=True
    ),
    Mutant(
        name="description not XML", rule="readable", words=("well-formed",), damage=file(DESCRIPTION, b"<fmiModel"),
        keeps_guid=True,
    ),
    Mutant(name="FMI 1", rule="readable", words=("fmiVersion = 1.0",), damage=root(fmiVersion="1.0")),
    Mutant(name="path out of the archive", rule="paths", words=("../run.py",), damage=file("../run.py", b"")),
    Mutant(name="absolute path", rule="paths", words=("/etc/motd",), damage=file("/etc/motd", b"")),
    Mutant(
        name="two files of one name", rule="entries", words=("resources/first.",), rewrite=_add_a_second_entry,
        damage=every(file("resources/first.", b""), file("resources/second", b"")),
    ),
    Mutant(
        name="no binary", rule="binaries", words=(PLANT, "found none"), damage=without("binaries/"),
        damage_3=every(without("binaries/"), without(_BUILD)),
    ),
    Mutant(
        name="binary of another name", rule="binaries", words=("Quadrotor under",),
        damage=element("CoSimulation", modelIdentifier="Quadrotor"),
    ),
    Mutant(
        name="no binary for this platform", rule="platform", words=(fmpy.platform,), words_3=(fmpy.platform_tuple,),
        damage=without(_HERE[0]), damage_3=without(_HERE[1]),
    ),
    Mutant(
        name="source that is not there", rule="source-files", words=("sources/other.c",),
        damage=_compiled_of("other.c"), damage_3=replaced(_BUILD, "fmi3.c", "other.c"),
    ),
    Mutant(
        name="script that is not there", rule="slave-module", words=("names slave,",),
        damage=file("resources/slavemodule.txt", b"slave"), versions=(2,),
    ),
    Mutant(
        name="script not named", rule="slave-module", words=("slavemodule.txt",),
        damage=without("resources/slavemodule.txt"), versions=(2,),
    ),
)  # fmt: skip

WHOLE = (
    Mutant(
        name="empty GUID", rule="guid", words=("guid = ''",), words_3=("instantiationToken = ''",),
        damage=root(guid=""), damage_3=root(instantiationToken=""), keeps_guid=True,
    ),
    Mutant(
        name="GUID of another content", rule="guid-of-content", words=("a1b2",),
        damage=root(guid=_GUID), damage_3=root(instantiationToken=_GUID), keeps_guid=True,
    ),
    Mutant(
        name="source changed, GUID not", rule="guid-of-content", words=("expected",), keeps_guid=True,
        damage=source("plant_fmu/interface.py", "0.9212", "0.9213"), damage_3=file("sources/fmi3.c", b"int main;"),
    ),
    Mutant(
        name="date in local time", rule="date", words=("+01:00",),
        damage=root(generationDateAndTime="2025-03-01T12:00:00+01:00"),
    ),
    Mutant(
        name="needs a tool", rule="execution-tool", words=("needsExecutionTool",),
        damage=element("CoSimulation", needsExecutionTool="true"),
    ),
    Mutant(
        name="serialises what it cannot save", rule="capabilities", words=("canGetAndSetFMUstate",),
        words_3=("canGetAndSetFMUState",),
        damage=element("CoSimulation", canGetAndSetFMUstate="false"),
        damage_3=element("CoSimulation", canGetAndSetFMUState="false"),
    ),
    Mutant(
        name="identifier not of C", rule="model-identifier", words=("Quadrotor-Plant",),
        damage=element("CoSimulation", modelIdentifier="Quadrotor-Plant"),
    ),
    Mutant(
        name="stop before start", rule="default-experiment", words=("stopTime", "startTime"),
        damage=element("DefaultExperiment", stopTime="-1.0"),
    ),
    Mutant(
        name="step not positive", rule="default-experiment", words=("stepSize",),
        damage=element("DefaultExperiment", stepSize="0.0"),
    ),
    Mutant(
        name="start not a number", rule="readable", words=("gravity", "g"), damage=variable("gravity", start="g")
    ),
    Mutant(
        name="page missing", rule="documentation", words=("documentation/index.html", "none"),
        damage=without("documentation/index.html"),
    ),
    Mutant(
        name="page empty", rule="documentation", words=("documentation/index.html", "an empty file"),
        damage=file("documentation/index.html", b" "),
    ),
    Mutant(
        name="icon missing", rule="documentation", words=(ICONS[2], "none"), words_3=(ICONS[3], "none"),
        damage=without(ICONS[2]), damage_3=without(ICONS[3]),
    ),
    Mutant(
        name="icon no picture", rule="documentation", words=(ICONS[2], "another file"), words_3=(ICONS[3], "another"),
        damage=file(ICONS[2], b"<svg/>"), damage_3=file(ICONS[3], b"<svg/>"),
    ),
    Mutant(
        name="slave describes another", rule="own-description", words=("mass", "description", "payload"),
        damage=source("plant_fmu/interface.py", '"mass m"', '"payload m"'), versions=(2,),
    ),
    Mutant(
        name="slave does not describe itself", rule="own-description", words=("SyntaxError",),
        damage=source("fmu_kit/write_description.py", "import os", "import os as"), versions=(2,),
    ),
)  # fmt: skip

VARIABLES = (
    Mutant(
        name="start wrong", rule="start-values", words=("gravity: start = 9.8,", "9.81"),
        damage=variable("gravity", start="9.8"),
    ),
    Mutant(
        name="start wrong in the last digit", rule="start-values", words=("gravity", "9.810000000000002", "9.81"),
        damage=variable("gravity", start="9.810000000000002"),
    ),
    Mutant(
        name="start of a Boolean wrong", rule="start-values", words=("use_reference_inputs",), model=CONTROLLER,
        damage=variable("use_reference_inputs", start="true"),
    ),
    Mutant(
        name="start in 16 digits", rule="start-text", words=("gravity", "9.810000000000000"),
        damage=variable("gravity", start="9.810000000000000"),
    ),
    Mutant(name="min above start", rule="bounds", words=("mass", "at least"), damage=variable("mass", min="2.0")),
    Mutant(
        name="max below start", rule="bounds", words=("surface_exponent", "at most"), model=CONTROLLER,
        damage=variable("surface_exponent", max="0.5"),
    ),
    Mutant(name="min above max", rule="bounds", words=("gravity", "above max"), damage=variable("gravity", max="-1.0")),
    Mutant(name="unit missing", rule="units", words=("mass", "unit"), damage=variable("mass", unit=None)),
    Mutant(name="unit not defined", rule="standard", words=("mass", "stone"), damage=variable("mass", unit="stone")),
    Mutant(name="exponent wrong", rule="unit-meaning", words=("unit N:", "s=-1", "s=-2"), damage=unit("N", s="-1")),
    Mutant(name="radian left out", rule="unit-meaning", words=("unit rad/s:", "rad=1"), damage=unit("rad/s", rad=None)),
    Mutant(name="factor wrong", rule="unit-meaning", words=("unit kg:", "0.001"), damage=unit("kg", factor="0.001")),
    Mutant(name="unit without base units", rule="units", words=("unit m:",), damage=_without_base_unit("m")),
    Mutant(
        name="array of no elements", rule="arrays", words=("tilt: dimensions 0",), versions=(3,),
        damage=_dimension("tilt", start="0"),
    ),
    Mutant(
        name="as many elements as a number", rule="indices", words=("velocity.y", "mass", "of Float64"), versions=(3,),
        damage=_dimension("velocity.y", of="mass"),
    ),
    Mutant(
        name="start of another length", rule="arrays", words=("mass: it starts with 2 values",), versions=(3,),
        damage=variable("mass", start="1.0 1.0"),
    ),
    Mutant(
        name="value reference twice", rule="value-references", rule_3="indices", words=("velocity.y", "10"),
        damage=variable("velocity.y", valueReference="10"),
    ),
    Mutant(
        name="value reference of two inputs", rule="aliases", rule_3="indices", words=("torque.x, torque.y",),
        damage=variable("torque.y", valueReference="1"),
    ),
    Mutant(
        name="two value references swapped", rule="value-references", words=("velocity.x", "11"),
        damage=_swap("valueReference", "velocity.x", "velocity.y"),
    ),
    Mutant(
        name="two names swapped", rule="own-description", words=("velocity.x", "velocity.y", "place"),
        damage=_swap("name", "velocity.x", "velocity.y"), versions=(2,),
    ),
    Mutant(
        name="name of no convention", rule="names", words=("velocity,x", "structured"),
        damage=variable("velocity.x", name="velocity,x"),
    ),
    Mutant(name="name twice", rule="standard", words=("velocity.x",), damage=variable("velocity.y", name="velocity.x")),
    Mutant(
        name="causality that there is none of", rule="standard", words=("causality", "result"),
        damage=variable("velocity.y", causality="result"),
    ),
    Mutant(
        name="Integer declared Real", rule="getters", words=("sample_count", "Real"), model=CONTROLLER,
        words_3=("sample_count", "Float64"), damage=_retype("sample_count", "Real", "Float64"),
    ),
    Mutant(name="input port missing", rule="ports", words=("torque.z",), damage=variable("torque.z", name="torque.w")),
    Mutant(
        name="input port a parameter", rule="ports", words=("thrust", "input", "parameter"),
        damage=variable("thrust", causality="parameter", variability="tunable"),
    ),
    Mutant(
        name="port of another unit", rule="ports", words=("position.z", "in m/s"), model=CONTROLLER,
        damage=variable("position.z", unit="m/s"),
    ),
)  # fmt: skip

STRUCTURE = (
    Mutant(
        name="output not listed", rule="outputs", words=("position.y",), damage=without_unknown("Outputs", "position.y")
    ),
    Mutant(
        name="initial unknown not listed", rule="initial-unknowns", words=("position.y",),
        damage=without_unknown("InitialUnknowns", "position.y"),
    ),
    Mutant(
        name="index that there is none of", rule="indices", words=("Output", "999"),
        damage=unknown("Outputs", "position.y", dependencies="999"),
    ),
    Mutant(
        name="dependency on a parameter", rule="known-dependencies", words=("position.y", "mass"),
        damage=depends("Outputs", "position.y", "mass"), versions=(2,),  # FMI 3.0 has them known at any time
    ),
    Mutant(
        name="dependency on a result", rule="known-dependencies", words=("position.y depends on tilt, a local",),
        damage=depends("InitialUnknowns", "position.y", "tilt"),
    ),
    Mutant(
        name="dependency added", rule="idle-dependency", words=("thrust", "position.y"),
        damage=depends("Outputs", "position.y", "thrust"),
    ),
    Mutant(
        name="dependency dropped", rule="undeclared-dependency", model=CONTROLLER,
        words=("torque.y moves with velocity.z in initialisation mode",),
        damage=_drop_dependency("torque.y", "velocity.z"),
    ),
    Mutant(
        name="dependency on a reference input dropped", rule="undeclared-dependency", model=CONTROLLER,
        words=("thrust moves with reference.acceleration.z",),
        damage=_drop_dependency("thrust", "reference.acceleration.z"),
    ),
    Mutant(
        name="dependency on a parameter dropped", rule="undeclared-dependency", model=CONTROLLER,
        words=("thrust moves with gravity in initialisation mode",), damage=_drop_dependency("thrust", "gravity"),
    ),
)  # fmt: skip

# -- those that the importer does more than to step ------------------------------------------------------


def _no_derivative(root: Element) -> None:
    declared = found(root, "ModelVariables/*[@name='dx1']")
    del (declared[0] if declared.tag == "ScalarVariable" else declared).attrib["derivative"]


def _listed(tag: str, name: str) -> Damage:
    """A variable is one more in the model structure of FMI 3.0, in the place of its kind."""

    def change(root: Element) -> None:
        SubElement(found(root, "ModelStructure"), tag, valueReference=handle_of(root, name))

    return description(change)


def _without_listed(tag: str) -> Damage:
    return description(lambda root: found(root, "ModelStructure").remove(found(root, f"ModelStructure/{tag}")))


_CARRIED = "extra/org.fmi-standard.fmi-ls-ref/"
_MANIFEST = b'<fmiReferences><Related type="text/csv" source="flight.csv" role="result"/></fmiReferences>'

STEPPED_FROM_OUTSIDE = (
    Mutant(
        name="derivative of nothing", rule="derivatives", words=("dx1", "no attribute derivative"), model=BALL,
        damage=description(_no_derivative), keeps_guid=True,
    ),
    Mutant(
        name="state not listed", rule="numbers-of-states", words=("2 continuous states", "says 1"), model=BALL,
        damage=_without_listed("ContinuousStateDerivative"), keeps_guid=True, versions=(3,),
    ),
    Mutant(
        name="event indicators miscounted", rule="numbers-of-states", words=("1 event indicators", "says 3"),
        model=BALL, damage=root(numberOfEventIndicators="3"), keeps_guid=True, words_3=("1 event indicators", "says 0"),
        damage_3=_without_listed("EventIndicator"),
    ),
    Mutant(
        name="clock without an interval", rule="clocks", words=("r: a constant clock without",), model=LAW,
        damage=variable("r", intervalDecimal=None), keeps_guid=True, versions=(3,),
    ),
    Mutant(
        name="clock that never ticks", rule="clocks", words=("r: intervalDecimal = 0",), model=LAW,
        damage=variable("r", intervalDecimal="0"), keeps_guid=True, versions=(3,),
    ),
    Mutant(
        name="clocked in continuous time", rule="clocks", words=("y: clocked, and continuous",), model=LAW,
        damage=variable("y", variability="continuous"), keeps_guid=True, versions=(3,),
    ),
    Mutant(
        name="clocked by a number", rule="clocks", words=("y: it ticks with p",), model=LAW,
        damage=variable("y", clocks="7"), keeps_guid=True, versions=(3,),
    ),
    Mutant(
        name="clocked output known at the start", rule="initial-unknowns", words=("y is there",), model=LAW,
        damage=_listed("InitialUnknown", "y"), keeps_guid=True, versions=(3,),
    ),
    Mutant(
        name="clock without event mode", rule="capabilities", words=("hasEventMode", "r"), model=LAW,
        damage=element("CoSimulation", hasEventMode="false"), keeps_guid=True, versions=(3,),
    ),
    Mutant(
        name="not finite at a tick", rule="interfaces", words=("event-mode: y = -inf after step 1",), model=LAW,
        damage=every(variable("u", start="1e308"), variable("w", start="1e308")), keeps_guid=True, versions=(3,),
    ),
    Mutant(
        name="job of a partition not finite", rule="interfaces", model=JOBS,
        words=("scheduled-execution inClock1: y = nan after step 1",),
        damage=variable("w", start="-3"), keeps_guid=True, versions=(3,),
    ),
    Mutant(
        name="results of another run", rule="carried-results", words=("gravity = 9.9 in its row 2", "9.81"),
        damage=every(
            file(f"{_CARRIED}fmi-ls-manifest.xml", _MANIFEST),
            file(f"{_CARRIED}flight.csv", b"time,gravity\n0,9.81\n0.01,9.9\n"),
        ),
    ),
)  # fmt: skip

_TILT = "self.wind_force, self.tilt = wind, tilt(attitude)"
_WRITTEN = "self.quaternion, self.angular_velocity = state.quaternion, state.angular_velocity"
_INITIAL_VELOCITY = "self.initial_velocity"
_STEP = "body, wind, actuators = self._body, self._wind, self._actuators"

BEHAVIOUR = (
    Mutant(
        name="output not finite", rule="finite-outputs", words=("position.x = nan",),
        damage=source("plant_fmu/observed.py", _TILT, f"{_TILT}\n        self.position = math.nan * self.position"),
        damage_3=fault("not finite"),
    ),
    Mutant(
        name="output follows an input", rule="undeclared-dependency",
        words=("position.y moves with thrust at a communication point",),
        damage=source("fmu_kit/slave.py", "[reals[vr] for vr", "[reals[vr] + (vr == 8) * reals[0] for vr"),
        damage_3=fault("follows"),
    ),
    Mutant(
        name="runs by chance", rule="repeatable", words=("as in an equal run before",),
        damage=source("plant_fmu/observed.py", _TILT, f'{_TILT}\n        self.tilt = __import__("random").random()'),
        damage_3=fault("by chance"),
    ),
    Mutant(
        name="state kept over reset", rule="reset", words=("without the run and reset before it",),
        damage=every(
            source("plant_fmu/slave.py", _WRITTEN, f"{_WRITTEN}\n        _KEPT[self.instance_name] = self.velocity"),
            source("plant_fmu/slave.py", "_MOTION = ", "_KEPT = {}\n_MOTION = "),
            source("plant_fmu/slave.py", _INITIAL_VELOCITY, f"_KEPT.get(self.instance_name, {_INITIAL_VELOCITY})"),
        ),
        damage_3=fault("keeps"),
    ),
    Mutant(
        name="state shared by instances", rule="instances", words=("position.x", "second instance"),
        damage=source("plant_fmu/slave.py", "self._state", "QuadrotorPlant._state"),
        damage_3=fault("shares"),
    ),
    Mutant(
        name="saved state incomplete", rule="saved-state", words=("from the state",),
        damage=source("plant_fmu/slave.py", "list(self._channels)", "[0.0, 0.0, 0.0, 0.0]"),
        damage_3=fault("forgets"),
    ),
    Mutant(
        name="saved clock incomplete", rule="saved-state", words=("from the state",), model=CONTROLLER,
        damage=source("controller_fmu/sampled.py", 'state["next_index"]', "0"),
        versions=(2,),
    ),
    Mutant(
        name="serialised state rounded", rule="serialised-state", words=("from the bytes",),
        damage=source(
            "fmu_kit/saved_state.py", "return state if checksum",
            'return {**state, "reals": [round(x, 9) for x in state["reals"]]} if checksum',
        ),
        damage_3=fault("rounds"),
    ),
    Mutant(
        name="input added when set twice", rule="inputs-set-twice", words=("set once",),
        damage=source(
            "fmu_kit/slave.py", "    reals[vr] = value\n", "    reals[vr] = value + (reals[vr] == value)\n"
        ),
        damage_3=fault("adds"),
    ),
    Mutant(
        name="steps of one length only", rule="variable-steps", words=("communicationStepSize = 0.004",),
        damage=source(
            "fmu_kit/slave.py", 'self._expect(Phase.STEPPING, "fmi2DoStep")',
            'require(abs(step_size - 0.01) < 1e-9, "communicationStepSize", step_size, "0.01 s")',
        ),
        damage_3=fault("one step only"),
    ),
    Mutant(
        name="torque refused", rule="general-run", words=("torque.x",),
        damage=source(
            "plant_fmu/slave.py", _STEP, f'require(self.torque.x == 0.0, "torque.x", 1, "0")\n        {_STEP}'
        ),
        damage_3=fault("no torque"),
    ),
    Mutant(
        name="error logged, none returned", rule="runs", words=("status 3", "something is odd"),
        damage=source(
            "fmu_kit/slave.py", "        self._take_parameters()\n        try:",
            '        self._take_parameters()\n        self.log("something is odd", Fmi2Status.error)\n        try:',
        ),
        damage_3=fault("odd"),
    ),
    Mutant(
        name="step that fails", rule="runs", words=("fmi2DoStep", "ZeroDivisionError"),
        damage=source("fmu_kit/slave.py", "if self._stale:\n            self", "if 1 // 0:\n            self"),
        damage_3=fault("fails"), words_3=("fmi3DoStep", "division by zero"),
    ),
    Mutant(
        name="script that does not run", rule="runs", words=("fmi2Instantiate",),
        damage=source("_entry.py", "super().__init__(**kwargs)", "raise RuntimeError('no')"),
        damage_3=fault("no instance"), words_3=("fmi3InstantiateCoSimulation: no",),
    ),
    Mutant(
        name="event mode asked for", rule="runs", words=("eventHandlingNeeded = true",), versions=(3,),
        damage=fault("event"),
    ),
    Mutant(
        name="early return", rule="runs", words=("earlyReturn = true",), versions=(3,), damage=fault("early"),
    ),
    Mutant(
        name="step to no time", rule="runs", words=("lastSuccessfulTime = nan",), versions=(3,),
        damage=fault("no time"),
    ),
    Mutant(
        name="process ends", rule="process", words=("exit code 3", "runs"),
        damage=source("plant_fmu/slave.py", _STEP, f"__import__('os')._exit(3)\n        {_STEP}"),
        damage_3=fault("exits"),
    ),
    Mutant(
        name="process crashes", rule="process",
        words=("SIGSEGV" if sys.platform != "win32" else "exit code", "runs, after t = 0 s"),
        damage=source("plant_fmu/slave.py", _STEP, f"__import__('ctypes').string_at(0)\n        {_STEP}"),
        versions=(2,),
    ),
    Mutant(
        name="step without end", rule="process", words=("limit of 4 s; a call does not return",), time_limit=4.0,
        damage=source("plant_fmu/slave.py", _STEP, f"__import__('time').sleep(1e6)\n        {_STEP}"),
        versions=(2,),
    ),
    Mutant(
        name="bound not enforced", rule="bounds-enforced", words=("mass = -1",),
        damage=source("fmu_kit/slave.py", "if variable.causality == \"parameter\"", "if False"),
        damage_3=fault("unbounded"),
    ),
    Mutant(
        name="value not finite taken", rule="not-finite-refused", words=("thrust = nan",),
        damage=source("fmu_kit/slave.py", "require(math.isfinite(value), ", "require(True, "),
        damage_3=fault("not a number"),
    ),
    Mutant(
        name="step past the stop time", rule="stop-time", words=("stopTime = 0.02",),
        damage=source("fmu_kit/slave.py", "if t + h - self._stop_time > slack:", "if False:"),
        damage_3=fault("stop not heeded"),
    ),
    Mutant(
        name="step anywhere", rule="consecutive-steps", words=("at the beginning of the step before",),
        damage=source("fmu_kit/slave.py", "abs(t - self._reached) > slack", "False"),
        damage_3=fault("any time"),
    ),
    Mutant(
        name="step not looked back", rule="consecutive-steps", words=("a step after its end",),
        damage=source("fmu_kit/slave.py", "abs(t - self._reached) > slack", "t < self._reached - slack"),
        damage_3=fault("not looked back"),
    ),
    Mutant(
        name="stop time before the start", rule="stop-before-start", words=("stopTime = -0.01",),
        damage=source("fmu_kit/slave.py", "require(stop_time >= start_time,", "require(True,"),
        damage_3=fault("stop before start"),
    ),
    Mutant(
        name="terminated twice", rule="terminated-once", words=("fmi2Terminate",),
        damage=source("fmu_kit/slave.py", 'self._expect(Phase.STEPPING, "fmi2Terminate")', "pass"),
        damage_3=fault("terminates twice"), words_3=("fmi3Terminate",),
    ),
    Mutant(
        name="fixed parameter set later", rule="fixed-parameters", words=("mass",),
        damage=source(
            "fmu_kit/slave.py",
            'raise FmuError(f"{variable.name}: a fixed parameter cannot be set after initialisation")', "pass",
        ),
        damage_3=fault("never fixed"),
    ),
)  # fmt: skip

MUTANTS = (*ARCHIVE, *WHOLE, *VARIABLES, *STRUCTURE, *STEPPED_FROM_OUTSIDE, *BEHAVIOUR)


def tables() -> dict[int, list[Verdict]]:
    """What is said of every mutant of freshly built FMUs, by the version of FMI."""
    found = {}
    for version in (2, 3):
        with tempfile.TemporaryDirectory() as folder:
            if version == 2:
                subjects = {path.stem: path for path in builder.build(MODELS, Path(folder))}
            else:
                subjects = {model: faulty(model, Path(folder)) for model in (PLANT, CONTROLLER)}
            subjects |= stepped_from_outside(version, Path(folder))
            mutants = [mutant for mutant in MUTANTS if version in mutant.versions]
            found[version] = verdicts(mutants, subjects, Path(folder))
    return found


def main() -> None:
    """Damage FMUs in every way and print the table."""
    print(as_markdown(tables()))


if __name__ == "__main__":
    main()
