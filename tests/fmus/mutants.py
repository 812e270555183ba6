"""FMUs of this project, each damaged in one way; `python -m tests.fmus.mutants` prints who notices.

Each mutant but those of the GUID itself has the GUID of its own content, so that this one rule cannot do the work
of all the others.
"""

import sys
import tempfile
from pathlib import Path
from xml.etree.ElementTree import Element

import fmpy

from orchestration.building import fmus
from orchestration.building.models import MODELS
from tests.fmus.damage import (
    DESCRIPTION,
    Damage,
    Files,
    Mutant,
    description,
    element,
    entry,
    every,
    file,
    found,
    index_of,
    root,
    source,
    unit,
    unknown,
    variable,
    without,
    without_unknown,
)
from tests.fmus.verdicts import as_markdown, verdicts

PLANT, CONTROLLER = "QuadrotorPlant", "UnifiedController"


def _nothing(files: Files) -> None:
    """Damage that is done to the archive instead."""


# -- damage that takes more than an attribute -----------------------------------------------------------


def _truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-2000])


def _flip_a_byte(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[content.index(b"class Quadrotor")] ^= 1
    path.write_bytes(content)


def _add_a_second_entry(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content.replace(b"resources/source_hash.txt", b"resources/slavemodule.txt"))


def _no_description(files: Files) -> None:
    files["modeldescription.xml"] = files.pop(DESCRIPTION)


def _swap(key: str, first: str, second: str) -> Damage:
    """Swap an attribute of two variables."""

    def change(root: Element) -> None:
        a, b = (found(root, f"ModelVariables/ScalarVariable[@name='{name}']") for name in (first, second))
        mine, theirs = a.get(key, ""), b.get(key, "")
        a.set(key, theirs)
        b.set(key, mine)

    return description(change)


def _drop_dependency(output: str, dropped: str) -> Damage:
    def change(root: Element) -> None:
        listed = entry(root, "InitialUnknowns", output)
        kept = [index for index in listed.get("dependencies", "").split() if index != str(index_of(root, dropped))]
        listed.set("dependencies", " ".join(kept))

    return description(change)


def _without_base_unit(name: str) -> Damage:
    def change(root: Element) -> None:
        defined = found(root, f"UnitDefinitions/Unit[@name='{name}']")
        defined.remove(found(defined, "BaseUnit"))

    return description(change)


def _retype(name: str, kind: str) -> Damage:
    def change(root: Element) -> None:
        found(root, f"ModelVariables/ScalarVariable[@name='{name}']")[0].tag = kind

    return description(change)


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
        name="two files of one name", rule="entries", words=("resources/slavemodule.txt",), damage=_nothing,
        rewrite=_add_a_second_entry,
    ),
    Mutant(name="no binary", rule="binaries", words=(PLANT, "found none"), damage=without("binaries/")),
    Mutant(
        name="binary of another name", rule="binaries", words=("Quadrotor under",),
        damage=element("CoSimulation", modelIdentifier="Quadrotor"),
    ),
    Mutant(
        name="no binary for this platform", rule="platform", words=(fmpy.platform,),
        damage=without(f"binaries/{fmpy.platform}/"),
    ),
    Mutant(
        name="script that is not there", rule="slave-module", words=("names slave,",),
        damage=file("resources/slavemodule.txt", b"slave"),
    ),
    Mutant(
        name="script not named", rule="slave-module", words=("slavemodule.txt",),
        damage=without("resources/slavemodule.txt"),
    ),
)  # fmt: skip

WHOLE = (
    Mutant(name="empty GUID", rule="guid", words=("guid = ''",), damage=root(guid=""), keeps_guid=True),
    Mutant(
        name="GUID of another content", rule="guid-of-content", words=("a1b2",),
        damage=root(guid="a1b2c3d4-0000-4000-8000-000000000000"), keeps_guid=True,
    ),
    Mutant(
        name="source changed, GUID not", rule="guid-of-content", words=("expected",), keeps_guid=True,
        damage=source("plant_fmu/interface.py", "0.9212", "0.9213"),
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
        damage=element("CoSimulation", canGetAndSetFMUstate="false"),
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
    Mutant(name="icon missing", rule="documentation", words=("model.png", "none"), damage=without("model.png")),
    Mutant(
        name="icon no picture", rule="documentation", words=("model.png", "another file"),
        damage=file("model.png", b"<svg/>"),
    ),
    Mutant(
        name="slave describes another", rule="own-description", words=("mass", "description", "payload"),
        damage=source("plant_fmu/interface.py", '"mass m"', '"payload m"'),
    ),
    Mutant(
        name="slave does not describe itself", rule="own-description", words=("SyntaxError",),
        damage=source("fmu_kit/model_description.py", "import os", "import os as"),
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
        name="value reference twice", rule="value-references", words=("velocity.y", "10"),
        damage=variable("velocity.y", valueReference="10"),
    ),
    Mutant(
        name="value reference of two inputs", rule="aliases", words=("torque.x, torque.y",),
        damage=variable("torque.y", valueReference="1"),
    ),
    Mutant(
        name="two value references swapped", rule="value-references", words=("velocity.x", "11"),
        damage=_swap("valueReference", "velocity.x", "velocity.y"),
    ),
    Mutant(
        name="two names swapped", rule="own-description", words=("velocity.x", "velocity.y", "place"),
        damage=_swap("name", "velocity.x", "velocity.y"),
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
        damage=_retype("sample_count", "Real"),
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
        name="index that there is none of", rule="indices", words=("Outputs", "999"),
        damage=unknown("Outputs", "position.y", dependencies="999"),
    ),
    Mutant(
        name="dependency on a parameter", rule="known-dependencies", words=("position.y", "mass"),
        damage=unknown("Outputs", "position.y", dependencies="21"),
    ),
    Mutant(
        name="dependency added", rule="idle-dependency", words=("thrust", "position.y"),
        damage=unknown("Outputs", "position.y", dependencies="1"),
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

_TILT = "self.wind_force, self.tilt = wind, tilt(state.quaternion)"
_INITIAL_VELOCITY = "self.initial_velocity"
_STEP = "body, wind, actuators = self._body, self._wind, self._actuators"

BEHAVIOUR = (
    Mutant(
        name="output not finite", rule="finite-outputs", words=("position.x = nan",),
        damage=source("plant_fmu/slave.py", _TILT, f"{_TILT}\n        self.position = math.nan * self.position"),
    ),
    Mutant(
        name="output follows an input", rule="undeclared-dependency",
        words=("position.y moves with thrust at a communication point",),
        damage=source("fmu_kit/slave.py", "[reals[vr] for vr", "[reals[vr] + (vr == 8) * reals[0] for vr"),
    ),
    Mutant(
        name="runs by chance", rule="repeatable", words=("as in an equal run before",),
        damage=source("plant_fmu/slave.py", _TILT, f'{_TILT}\n        self.tilt = __import__("random").random()'),
    ),
    Mutant(
        name="state kept over reset", rule="reset", words=("without the run and reset before it",),
        damage=every(
            source("plant_fmu/slave.py", _TILT, f"{_TILT}\n        _KEPT[self.instance_name] = state.velocity"),
            source("plant_fmu/slave.py", "_MOTION = ", "_KEPT = {}\n_MOTION = "),
            source("plant_fmu/slave.py", _INITIAL_VELOCITY, f"_KEPT.get(self.instance_name, {_INITIAL_VELOCITY})"),
        ),
    ),
    Mutant(
        name="state shared by instances", rule="instances", words=("position.x", "second instance"),
        damage=source("plant_fmu/slave.py", "self._state", "QuadrotorPlant._state"),
    ),
    Mutant(
        name="saved state incomplete", rule="saved-state", words=("from the state",),
        damage=source("plant_fmu/slave.py", "list(self._channels)", "[0.0, 0.0, 0.0, 0.0]"),
    ),
    Mutant(
        name="saved clock incomplete", rule="saved-state", words=("from the state",), model=CONTROLLER,
        damage=source("controller_fmu/sampled.py", 'state["next_index"]', "0"),
    ),
    Mutant(
        name="serialised state rounded", rule="serialised-state", words=("from the bytes",),
        damage=source(
            "fmu_kit/saved_state.py", "return state if checksum",
            'return {**state, "reals": [round(x, 9) for x in state["reals"]]} if checksum',
        ),
    ),
    Mutant(
        name="input added when set twice", rule="inputs-set-twice", words=("set once",),
        damage=source(
            "fmu_kit/slave.py", "    reals[vr] = value\n", "    reals[vr] = value + (reals[vr] == value)\n"
        ),
    ),
    Mutant(
        name="steps of one length only", rule="variable-steps", words=("communicationStepSize = 0.004",),
        damage=source(
            "fmu_kit/slave.py", 'self._expect(Phase.STEPPING, "fmi2DoStep")',
            'require(abs(step_size - 0.01) < 1e-9, "communicationStepSize", step_size, "0.01 s")',
        ),
    ),
    Mutant(
        name="torque refused", rule="general-run", words=("torque.x",),
        damage=source(
            "plant_fmu/slave.py", _STEP, f'require(self.torque.x == 0.0, "torque.x", 1, "0")\n        {_STEP}'
        ),
    ),
    Mutant(
        name="error logged, none returned", rule="runs", words=("status 3", "something is odd"),
        damage=source(
            "fmu_kit/slave.py", "        self._take_parameters()\n        try:",
            '        self._take_parameters()\n        self.log("something is odd", Fmi2Status.error)\n        try:',
        ),
    ),
    Mutant(
        name="step that fails", rule="runs", words=("fmi2DoStep", "ZeroDivisionError"),
        damage=source("fmu_kit/slave.py", "if self._stale:\n            self", "if 1 // 0:\n            self"),
    ),
    Mutant(
        name="script that does not run", rule="runs", words=("fmi2Instantiate",),
        damage=source("_entry.py", "super().__init__(**kwargs)", "raise RuntimeError('no')"),
    ),
    Mutant(
        name="process ends", rule="process", words=("exit code 3", "runs"),
        damage=source("plant_fmu/slave.py", _STEP, f"__import__('os')._exit(3)\n        {_STEP}"),
    ),
    Mutant(
        name="process crashes", rule="process", words=("SIGSEGV" if sys.platform != "win32" else "exit code", "runs"),
        damage=source("plant_fmu/slave.py", _STEP, f"__import__('ctypes').string_at(0)\n        {_STEP}"),
    ),
    Mutant(
        name="step without end", rule="process", words=("limit of 8 s; a call does not return",), time_limit=8.0,
        damage=source("plant_fmu/slave.py", _STEP, f"__import__('time').sleep(1e6)\n        {_STEP}"),
    ),
    Mutant(
        name="bound not enforced", rule="bounds-enforced", words=("mass = -1",),
        damage=source("fmu_kit/slave.py", "if variable.causality == \"parameter\"", "if False"),
    ),
    Mutant(
        name="value not finite taken", rule="not-finite-refused", words=("thrust = nan",),
        damage=source("fmu_kit/slave.py", "require(math.isfinite(value), ", "require(True, "),
    ),
    Mutant(
        name="step past the stop time", rule="stop-time", words=("stopTime = 0.02",),
        damage=source("fmu_kit/slave.py", "if t + h - self._stop_time > slack:", "if False:"),
    ),
    Mutant(
        name="step anywhere", rule="consecutive-steps", words=("at the beginning of the step before",),
        damage=source("fmu_kit/slave.py", "abs(t - self._reached) > slack", "False"),
    ),
    Mutant(
        name="step not looked back", rule="consecutive-steps", words=("a step after its end",),
        damage=source("fmu_kit/slave.py", "abs(t - self._reached) > slack", "t < self._reached - slack"),
    ),
    Mutant(
        name="stop time before the start", rule="stop-before-start", words=("stopTime = -0.01",),
        damage=source("fmu_kit/slave.py", "require(stop_time >= start_time,", "require(True,"),
    ),
    Mutant(
        name="terminated twice", rule="terminated-once", words=("fmi2Terminate",),
        damage=source("fmu_kit/slave.py", 'self._expect(Phase.STEPPING, "fmi2Terminate")', "pass"),
    ),
    Mutant(
        name="fixed parameter set later", rule="fixed-parameters", words=("mass",),
        damage=source(
            "fmu_kit/slave.py",
            'raise FmuError(f"{variable.name}: a fixed parameter cannot be set after initialisation")', "pass",
        ),
    ),
)  # fmt: skip

MUTANTS = (*ARCHIVE, *WHOLE, *VARIABLES, *STRUCTURE, *BEHAVIOUR)


def main() -> None:
    """Damage freshly built FMUs in every way and print the table."""
    with tempfile.TemporaryDirectory() as folder:
        built = {path.stem: path for path in fmus.build(MODELS, Path(folder))}
        print(as_markdown(verdicts(MUTANTS, built, Path(folder))))


if __name__ == "__main__":
    main()
