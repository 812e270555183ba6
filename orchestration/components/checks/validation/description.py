"""Rules on the model description as a whole."""

import math
import re
from collections.abc import Iterator

from fmu_kit.archive import NATIVE_TABLES
from orchestration.components.checks.validation.fmu import LIBRARIES, Fmu
from orchestration.components.fmi.archive import TOKENS, Archive
from orchestration.components.fmi.slaves import ENTRY


def standard(archive: Archive) -> list[str]:
    """The checks of fmpy: schema, duplicate names, required starts, combinations of attributes, units, structure.

    What InitialUnknowns lacks is left to `structure.initial_unknowns`, which names it variable by variable.
    """
    from fmpy import read_model_description
    from fmpy.model_description import ValidationError

    problems = []
    try:
        read_model_description(str(archive.path), validate_model_structure=True)  # names: by `variables.names`
    except ValidationError as error:
        problems = error.problems
    except IndexError:
        return []  # an index of ModelStructure, which `indices` names
    except KeyError as error:
        of = "a displayUnit without a unit" if error.args == (None,) else f"{error}, which is not declared"
        problems = [f"a variable refers to {of}; fmpy reads no further"]
    except Exception as error:  # it reads attributes strictly, and fails on damage in various ways
        problems = [f"fmpy does not read it: {type(error).__name__}: {error}"]
    texts = [" ".join(str(problem).split()) for problem in problems]
    return [text for text in texts if not re.match(r"ModelStructure/InitialUnknowns? does not contain", text)]


def guid(fmu: Fmu) -> Iterator[str]:
    """It is not empty: the schema allows that, but a library identifies its description by it."""
    if not fmu.description.guid.strip():
        yield f"{TOKENS[fmu.version]} = {fmu.description.guid!r}: expected a text that is not empty"


def model_identifier(fmu: Fmu) -> Iterator[str]:
    """It is a valid C name, as that of a file and of functions (FMI 2.0.4, section 2.1.1; FMI 3.0, 2.4.2)."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", fmu.model_identifier):
        yield f"modelIdentifier = {fmu.model_identifier!r}: expected a name by C syntax"


def capabilities(fmu: Fmu) -> Iterator[str]:
    """Serialising a state requires saving it; in FMI 3.0 clocks require event mode, early return updates."""
    interface, state = fmu.interface, "FMUstate" if fmu.version == 2 else "FMUState"
    if interface.canSerializeFMUstate and not interface.canGetAndSetFMUstate:
        yield f"canGetAndSet{state} = false: expected true, since canSerialize{state} is"
    if fmu.description.coSimulation is None:
        return
    if interface.canReturnEarlyAfterIntermediateUpdate and not interface.providesIntermediateUpdate:
        yield "providesIntermediateUpdate = false: expected true, since canReturnEarlyAfterIntermediateUpdate is"
    clocks = [v.name for v in fmu.variables if v.type == "Clock"]
    if clocks and not interface.hasEventMode:
        yield f"hasEventMode = false: expected true, for the clocks {', '.join(clocks)}"


def default_experiment(fmu: Fmu) -> Iterator[str]:
    """Its times, step size and tolerance are valid."""
    experiment = fmu.experiment
    for key, value in experiment.items():
        if not math.isfinite(value):
            yield f"{key} = {value}: expected a finite number"
    start, stop = experiment.get("startTime", 0.0), experiment.get("stopTime")
    if stop is not None and not stop > start:
        yield f"stopTime = {stop}: expected a time after startTime = {start}"
    for key in ("stepSize", "tolerance"):
        if not experiment.get(key, 1.0) > 0.0:
            yield f"{key} = {experiment[key]}: expected a positive number"


def binaries(fmu: Fmu) -> Iterator[str]:
    """A library for at least one platform is named after the model identifier, or the FMU has sources."""
    files = fmu.archive.files
    libraries = [name for name in files if name.startswith("binaries/") and name.endswith(LIBRARIES)]
    if any(name.rpartition("/")[2].rpartition(".")[0] == fmu.model_identifier for name in libraries):
        return
    if not _comes_as_sources(fmu):
        found = ", ".join(libraries) or "none"
        yield f"expected a library of the name {fmu.model_identifier} under binaries/, found {found}"


def source_files(fmu: Fmu) -> Iterator[str]:
    """Every declared source file is in sources/."""
    for name in fmu.source_files:
        if f"sources/{name}" not in fmu.archive.files:
            yield f"expected sources/{name}, which is to be compiled, found none"


def _comes_as_sources(fmu: Fmu) -> bool:
    """Whether there are sources to compile; in FMI 3.0 these are declared for a library of that name."""
    return bool(fmu.source_files) or (
        fmu.version == 2 and any(name.startswith("sources/") for name in fmu.archive.files)
    )


def slave_module(fmu: Fmu) -> Iterator[str]:
    """The script that pythonfmu runs exists, unless the FMU has no Python inside."""
    files = fmu.archive.files
    if ENTRY not in files:
        if fmu.is_ours and NATIVE_TABLES not in files:
            yield f"{ENTRY}: expected this file, with the name of the script in resources/"
        return
    name = files[ENTRY].decode("utf-8", "replace").strip()
    if f"resources/{name}.py" not in files:
        yield f"{ENTRY}: it names {name}, expected a script in resources/; there is no resources/{name}.py"


RULES = (guid, model_identifier, capabilities, default_experiment, binaries, source_files, slave_module)
