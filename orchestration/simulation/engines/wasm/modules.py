"""Compiles a system in C to the WebAssembly module of a page."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from fmu_kit.compiler.pack.c_compiler import Unit, linked_for_wasm
from fmu_kit.compiler.pack.lanes import MAIN, USER_OBJECT
from fmu_kit.compiler.runtime import FOLDER
from fmu_kit.libraries import cached_library
from orchestration.foundation.basics.c_structures import compiler_errors
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.engines.batch.kernels import FILES, sources_of
from orchestration.simulation.engines.wasm.tables_of_system import SystemTables
from orchestration.systems.schedule.compiled_timetable import FILES as TIMETABLE

_HERE = Path(__file__).parent
_FUNCTIONS = "lane_functions.h"
_OF_COMPONENTS = ("lanes", "places", "variables", "divergence", "begin", "initialise", "do_step", "do_steps", "line")


def units_of(tables: SystemTables, lanes: int) -> list[Unit]:
    """What is compiled of a system."""
    shape, defined = tables.shape, (f"-DQUADCOSIM_LANES={lanes}",)
    units = [_component(i, tables, defined) for i in range(len(shape.names))]
    ours = {path.name: path.read_bytes() for path in (_HERE / "live.h", _HERE / "live.c", _HERE / "timing.c")}
    timing = {path.name: path.read_bytes() for path in TIMETABLE} | {"timing.h": tables.timing.encode()}
    bits = ", ".join(f"1ull << {lane}" for lane in range(lanes))
    sizes = (
        f"#define CHANNELS {len(shape.system.connections) or 1}\n"
        f"#define HAS_CONDITION {int(shape.condition is not None)}\n"
        f"#define KEPT {len(shape.expressions.folds.kept)}\n#define LANE_BITS {{{bits}}}\n"
    )
    system = {path.name: path.read_bytes() for path in (*FILES, FOLDER / "integers.h")} | {
        "sizes.h": sizes.encode(), "expressions.h": shape.expressions.text.encode(),
        "system.h": tables.system.encode(),
    }  # fmt: skip
    units.append(Unit(sources={**ours, **timing}, main="timing.c", options=(*defined, "-Os")))
    units.append(Unit(sources={**ours, **system}, main="live.c", options=defined))
    return units


def _component(i: int, tables: SystemTables, defined: tuple[str, ...]) -> Unit:
    name = tables.shape.names[i]
    sources = dict(sources_of(name, tables.shape.models[name]))
    if USER_OBJECT in sources:
        raise UsageError(
            f"components.{name}: its C is compiled for this machine, and does not run in a page: expected a component "
            "in Python, as from quadcosim new controller NAME"
        )
    sources[_FUNCTIONS] = _specialised(sources[_FUNCTIONS].decode(), _fixed(name, tables)).encode()
    renamed = tuple(f"-Dquadcosim_{each}=c{i}_{each}" for each in _OF_COMPONENTS)
    is_alone = tables.shape.lanes == 1 and list(tables.shape.wires.continuous) == [i]
    several = ("-DQUADCOSIM_SEVERAL",) if is_alone else ()
    return Unit(sources=sources, main=MAIN, options=(*defined, *several, *renamed))


def _fixed(component: str, tables: SystemTables) -> dict[str, float]:
    """The whole numbers among the parameters of a component that a page cannot change; those by name are chosen by
    their index unless that is 0.
    """
    fixed, place = {}, f"components.{component}.parameters."
    for setting in tables.settings.all:
        if setting.path.startswith(place) and setting.is_whole and setting.low == setting.high:
            fixed[setting.path.removeprefix(place)] = setting.value
    return {name: value for name, value in fixed.items() if fixed.get(f"{name}_index", 0.0) == 0.0}


def _specialised(code: str, fixed: Mapping[str, float]) -> str:
    """The code with fixed parameters as constants where they are read: what they do not choose is left out.

    Beside a straight line, the functions for all other steps are small rather than fast.
    """
    if "#define STRAIGHT_STEP " in code:
        code = re.sub(r"^static q_mask (?=model_)", "static __attribute__((minsize)) q_mask ", code, flags=re.MULTILINE)
    for name, value in fixed.items():
        place = f"v[AT_{re.sub(r'[^A-Z0-9]', '_', name.upper())}]"
        is_set = f"{place} =" in code and f"{name}_index" not in fixed
        code = code if is_set else re.sub(rf"{re.escape(place)}(?! =)", f"q_all({value!r})", code)
    return code


def module_of(tables: SystemTables, lanes: int) -> bytes:
    """The WebAssembly module of a system for a number of SIMD lanes; raises `QuadcosimError` without its compiler."""
    units, options = units_of(tables, lanes), ("-msimd128",) if lanes > 1 else ()
    what = ("wasm", lanes, options, tuple(u.options for u in units))
    with compiler_errors():
        library = cached_library("wasm", sources_in(units), what, lambda: linked_for_wasm(units, options))
    return library.read_bytes()


def sources_in(units: Sequence[Unit]) -> dict[str, bytes]:
    """The sources of what is compiled, by the number of the unit and their name."""
    return {f"{i}/{name}": text for i, unit in enumerate(units) for name, text in unit.sources.items()}
