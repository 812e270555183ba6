"""Packing a user's own C as an .fmu: his sources as they are, behind the C that every FMU of this kit has.

The code runs once while its FMU is made, for its start values. So this is a separate process:
`python -m fmu_kit.compiler.pack.wrapping`, with the description of the code as JSON.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.dom.minidom import parseString
from xml.etree.ElementTree import Element, SubElement, tostring

from fmu_kit import archive
from fmu_kit.archive import WRAPPED_FILE, content_guid, write_archive
from fmu_kit.bundle import PackagingError
from fmu_kit.compiler.emit.standards import STANDARDS, Standard
from fmu_kit.compiler.emit.tables import tables
from fmu_kit.compiler.emit.user_code import Code, Place, Task, UserCode, places, texts, user_code
from fmu_kit.compiler.pack import c_compiler
from fmu_kit.compiler.pack.freshness import wrapping_hash
from fmu_kit.compiler.pack.lanes import MAIN, USER_OBJECT
from fmu_kit.compiler.pack.user_objects import Objects, RefusedCodeError, build_objects, libraries
from fmu_kit.compiler.runtime import FOLDER
from fmu_kit.interface import FixedParameter, Input, Output
from fmu_kit.libraries import cached_content
from fmu_kit.new_files import WriteError
from fmu_kit.scratch import temporary_folder
from fmu_kit.slave import Slave
from fmu_kit.versions import project_version
from fmu_kit.write_description import GUID_PLACEHOLDER

REFUSED = 2
"""The exit code for code that cannot be wrapped as it is"""
_LONGEST = 60.0
"""The most seconds that the code's initialisation may take"""
_BESIDE = ("exchange.h", "instance.h", "integers.h", "lanes.h", "mathematics.h", "text.h", "wrapped.h")
_OF_LANES = ("integers.h", "lanes.h", "mathematics.h", "places.h", "wrapped.h")
_DECLARATIONS = {"input": Input, "output": Output, "parameter": FixedParameter}


@dataclass(frozen=True, kw_only=True)
class _Program:
    """What the tables of an FMU are made of."""

    model: str
    slave: type[Slave]
    states: tuple[()] = ()


def build(code: UserCode, out: Path, version: int = 2, systems: Sequence[str] = ()) -> Path:
    """Write `out`, an FMU of FMI 2.0 or 3.0 with the code of a user, and return its path.

    It has a library for this machine, and for each of `systems` one that is compiled by zig. These other systems have
    no sections with names, so that for all of them a process can have one instance, whose state is not saved.
    """
    standard = STANDARDS[version]
    if version == 2:  # which has no partitions
        code = replace(code, tasks=tuple(replace(task, name="") for task in code.tasks))
    here = c_compiler.host_platform(version)
    if here is None:
        raise PackagingError("wrap: expected Linux on x86-64 or ARM; it uses sections of ELF")
    with temporary_folder() as folder:
        user = folder / f"user_code{'.cpp' if code.is_cxx else '.c'}"
        (folder / user.name).write_text(user_code(code), encoding="utf-8")
        objects = build_objects(code, user, folder)
        (folder / "probe.c").write_bytes((FOLDER / "wrapped_probe.c").read_bytes())
        for warning in objects.warnings:
            print(warning, file=sys.stderr)
        starts = _starts(code, objects, folder)
        slave = _slave(code, starts)
        whole = objects.is_pure and not systems
        fixed = {name: (FOLDER / name).read_text(encoding="utf-8") for name in (standard.main, *_BESIDE)}
        texts_ = {
            **fixed,
            "places.h": places(code, starts, objects.state_bytes),
            "functions.h": f"{texts(code)}\n{(FOLDER / 'wrapped_instance.h').read_text(encoding='utf-8')}",
            "tables.h": tables(_Program(model=code.name, slave=slave), GUID_PLACEHOLDER, standard),  # type: ignore[arg-type]
        }
        description = _description(standard, slave, code, once=not whole)
        files = {"modelDescription.xml": description, **_record(code, objects)}
        if version == 2 and whole:
            files |= _lanes(texts_, objects)
        files |= _licensed(code)
        guid = content_guid({**files, **{f"c/{name}": text.encode() for name, text in texts_.items()},
                             f"c/{USER_OBJECT}": objects.path.read_bytes()})  # fmt: skip
        texts_["tables.h"] = texts_["tables.h"].replace(GUID_PLACEHOLDER, guid)
        files["modelDescription.xml"] = description.replace(GUID_PLACEHOLDER.encode(), guid.encode())
        sources = {name: text.encode() for name, text in texts_.items()} | {USER_OBJECT: objects.path.read_bytes()}
        files[c_compiler.library_path(here, code.name)] = _library(code, sources, standard.main)
        for system in systems:
            for name, library in _elsewhere(code, system, texts_, standard, folder).items():
                files[c_compiler.library_path(name, code.name)] = library
    write_archive(out, files, first="modelDescription.xml")
    return out


def _library(code: UserCode, sources: Mapping[str, bytes], main: str) -> bytes:
    options = (*c_compiler.OF_LIBRARY, "-Wl,-Bsymbolic", "-Wl,-z,defs", USER_OBJECT, *libraries(code))
    compile_ = functools.partial(c_compiler.compiled_here, sources, main, options=options, has_lines=True)
    return cached_content("native", sources, (c_compiler.OPTIONS, options, main), compile_)


def _starts(code: UserCode, objects: Objects, folder: Path) -> list[float]:
    """The values of the variables after the code's initialisation, which runs here."""
    options = ["-std=gnu11", "-w", f"-DVARIABLES={len(code.places)}"]
    whole = [c_compiler.compiler(), *options, "probe.c", str(objects.path), *libraries(code), "-o", "probe"]
    c_compiler.output_of(whole, folder)
    where = f"{code.file}:{code.init.line}: init" if code.init is not None else f"{code.file}: init"
    try:
        done = subprocess.run([str(folder / "probe")], capture_output=True, text=True, timeout=_LONGEST, check=False)
    except subprocess.TimeoutExpired:
        raise RefusedCodeError(f"{where}: expected it to end within {_LONGEST:g} s") from None
    if done.returncode != 0:
        raise RefusedCodeError(f"{where}: ended by signal {-done.returncode}: expected it to return")
    starts = [float.fromhex(line) for line in done.stdout.split()]
    for place, start in zip(code.places, starts, strict=True):
        if start - start != 0.0:
            raise RefusedCodeError(
                f"{code.file}:{place.lvalue.line}: {place.name} = {start} after init: expected a finite value"
            )
    return starts


def _slave(code: UserCode, starts: Sequence[float]) -> type[Slave]:
    """A class that declares the variables; it computes nothing."""
    declared: dict[str, Any] = {
        f"v{number}": _DECLARATIONS[place.causality](
            place.description, place.unit, start, name=place.name, minimum=place.minimum, maximum=place.maximum,
            variability="fixed" if place.causality == "parameter" else "discrete",
        )
        for number, (place, start) in enumerate(zip(code.places, starts, strict=True))
    }  # fmt: skip
    parameters = frozenset(place.name for place in code.having("parameter"))
    attributes = {
        "description": code.description,
        "author": code.author,
        "license": code.license,
        "default_experiment": type(Slave.default_experiment)(start_time=0.0, stop_time=30.0, step_size=code.period),
        "step": lambda self, t, h: None,
        "initial_dependencies": classmethod(lambda cls, output: parameters),
        **declared,
    }
    return type(code.name, (Slave,), attributes)


def _description(standard: Standard, slave: type[Slave], code: UserCode, *, once: bool) -> bytes:
    """The model description: that of a slave, with what this FMU does not offer."""
    root = standard.describe(slave, standard.main)
    kind = root.find("CoSimulation")
    assert kind is not None
    for element in kind.findall("SourceFiles"):
        kind.remove(element)
    answers = {
        "canBeInstantiatedOnlyOncePerProcess": once,
        "canGetAndSetFMUstate": not once,
        "canGetAndSetFMUState": not once,
        "canSerializeFMUstate": not once,
        "canSerializeFMUState": not once,
        "providesDirectionalDerivative": False,
        "providesDirectionalDerivatives": False,
    }
    for name, answer in answers.items():
        if name in kind.attrib:
            kind.set(name, str(answer).lower())
    if code.partitions:
        _add_partitions(root, kind, code.partitions)
    root.set("generationTool", f"quadcosim-wrap {project_version()}")
    _drop_empty(root)
    return bytes(parseString(tostring(root)).toprettyxml(indent="  ", encoding="UTF-8"))


def _add_partitions(root: Element, kind: Element, tasks: Sequence[Task]) -> None:
    """Scheduled execution, and event mode: a clock for each task, and all inputs and outputs belong to each."""
    scheduled = Element("ScheduledExecution", {
        key: value for key, value in kind.attrib.items() if key in (
            "modelIdentifier", "needsExecutionTool", "canBeInstantiatedOnlyOncePerProcess", "canGetAndSetFMUState",
            "canSerializeFMUState",
        )
    })  # fmt: skip
    kind.set("hasEventMode", "true")
    root.insert([*root].index(kind) + 1, scheduled)
    variables, structure = root.find("ModelVariables"), root.find("ModelStructure")
    assert variables is not None
    assert structure is not None
    clocks = [str(len(variables) + number) for number in range(len(tasks))]
    for variable in variables:
        if variable.get("causality") in ("input", "output"):
            variable.set("clocks", " ".join(clocks))
    for reference, task in zip(clocks, tasks):
        SubElement(
            variables, "Clock", name=task.name, valueReference=reference, causality="input", variability="discrete",
            intervalVariability="fixed", intervalDecimal=repr(task.period),
        )  # fmt: skip
    for unknown in structure.findall("InitialUnknown"):  # which are not clocked
        structure.remove(unknown)


def _drop_empty(root: Element) -> None:
    """Leave out lists without elements, and descriptions that nobody wrote, which the schema does not allow."""
    for name in ("UnitDefinitions", "VendorAnnotations"):
        found = root.find(name)
        if found is not None and not len(found):
            root.remove(found)
    for variable in root.iter():
        if variable.get("description") == "":
            del variable.attrib["description"]


def _record(code: UserCode, objects: Objects) -> dict[str, bytes]:
    """What the FMU says of its origin: files with their hashes, by which it is known as up to date, and the period."""
    read = {
        os.path.relpath(path, code.folder): hashlib.sha256(Path(path).read_bytes()).hexdigest() for path in objects.read
    }
    record = {"file": code.file, "toml": code.hash, "kit": wrapping_hash(), "period": code.period, "read": read}
    return {WRAPPED_FILE: json.dumps(record, indent=1).encode()}


def _lanes(texts_: Mapping[str, str], objects: Objects) -> dict[str, bytes]:
    """What the lanes of many runs at once are compiled from."""
    files = {name: texts_[name].encode() for name in _OF_LANES} | {USER_OBJECT: objects.path.read_bytes()}
    files |= {MAIN: (FOLDER / MAIN).read_bytes(), "lane_functions.h": (FOLDER / "wrapped_lanes.h").read_bytes()}
    return {f"{archive.LANES_FOLDER}{name}": content for name, content in files.items()}


def _licensed(code: UserCode) -> dict[str, bytes]:
    """The sources, in an FMU that names their licence."""
    if not code.license:
        return {}
    paths = {source: Path(code.folder, source) for source in code.sources}
    return {f"documentation/c/{Path(name).name}": path.read_bytes() for name, path in paths.items()}


def _elsewhere(
    code: UserCode, system: str, texts_: Mapping[str, str], standard: Standard, folder: Path
) -> dict[str, bytes]:
    """The library for another system, compiled by zig from the sources; without sections it has one instance."""
    if any(not source.endswith(".c") for source in code.sources):
        raise RefusedCodeError(f"{code.file}: sources: expected C alone for --target")
    stateless = re.sub(r"(?m)^#define STATE_BYTES .*", "#define STATE_BYTES 0", texts_["places.h"])
    sources = {**{name: text.encode() for name, text in texts_.items()}, "places.h": stateless.encode()}
    sources["user_code.c"] = (folder / "user_code.c").read_bytes()
    others = [str(Path(code.folder, source).resolve()) for source in code.sources]
    options = [*(f"-I{Path(code.folder, path).resolve()}" for path in code.include), "-w",
               *(f"-D{define}" for define in code.defines)]  # fmt: skip
    after = [*options, "user_code.c", *others, "-lm"]
    return c_compiler.compiled_for(system, sources, standard.main, standard.version, after)


def main(arguments: list[str]) -> int:
    """`python -m fmu_kit.compiler.pack.wrapping OUT.fmu VERSION SYSTEMS`, with the code as JSON on standard input."""
    out, version, systems = arguments
    try:
        code = from_json(sys.stdin.read())
        print(build(code, Path(out), int(version), c_compiler.targets_of(systems) if systems else ()))
    except RefusedCodeError as error:
        print(error, file=sys.stderr)
        return REFUSED
    except (PackagingError, WriteError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def from_json(text: str) -> UserCode:
    """The description of code, from the JSON of its fields."""
    given = json.loads(text)
    for name in ("declare", "init", "after_parameters"):
        given[name] = None if given[name] is None else Code(**given[name])
    lists = {name: tuple(given[name]) for name in ("sources", "defines")}
    lists["include"] = (*given["include"], ".")  # of a header beside the file
    lists["headers"] = tuple(Code(**each) for each in given["headers"])
    lists["tasks"] = tuple(Task(**{**each, "step": Code(**each["step"])}) for each in given["tasks"])
    lists["places"] = tuple(Place(**{**each, "lvalue": Code(**each["lvalue"])}) for each in given["places"])
    return UserCode(**{**given, **lists})


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
