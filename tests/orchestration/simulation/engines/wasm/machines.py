"""The module of a page, called from Python: as a library of this machine, or by wasmtime."""

import ctypes
import functools
import hashlib
import struct
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from fmu_kit import libraries
from fmu_kit.compiler.pack.c_compiler import FOR_THIS_PROCESSOR, OPTIONS, compiler, linked
from orchestration.components.fmi.read_description import read_model
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.simulation.engines.wasm.modules import sources_in, units_of
from orchestration.simulation.engines.wasm.tables_of_system import SystemTables, tables_of
from orchestration.simulation.requests.request import request_of
from orchestration.systems.system.check import connect_references
from orchestration.systems.system.files import located

_ADDRESSES = (
    "settings_of", "outcomes", "outcome_times", "step_counts", "row_counts", "rows_of", "values_of_objectives",
)  # fmt: skip


def tables(request, lanes):
    """The tables of a request."""
    system = located(request_of(request).as_system())
    models = {name: read_model(Path(component.fmu)) for name, component in system.components.items()}
    system = check_against_fmus(connect_references(system, models), models).system
    return tables_of(Shape(system=system, models=models, lanes=lanes))


def library_of(tables: SystemTables) -> Path:
    """The module of one lane as a library of this machine."""
    units, options = units_of(tables, 1), (*FOR_THIS_PROCESSOR, "-Wno-psabi")
    what = ("live", options, tuple(unit.options for unit in units))
    made = functools.partial(linked, [compiler()], [*OPTIONS, *options], units, ["-lm"])
    return libraries.cached_library("live", sources_in(units), what, made)


def decimal_of(value: float) -> tuple[int, int]:
    """Digits and exponent of the shortest decimal form of a number: value = digits · 10^exponent."""
    sign, digits, exponent = Decimal(repr(value)).normalize().as_tuple()
    assert isinstance(exponent, int)
    number = int("".join(map(str, digits)))
    return (-number if sign else number), exponent if number else 0


class Native:
    """A library of this machine."""

    def __init__(self, path):
        self._library = ctypes.CDLL(str(path))
        for name in _ADDRESSES:
            getattr(self._library, name).restype = ctypes.c_void_p

    def call(self, name, *values):
        return getattr(self._library, name)(*values)

    def read(self, address, size):
        return ctypes.string_at(address, size)

    def write(self, address, data):
        ctypes.memmove(address, data, len(data))


class Wasm:
    """A WebAssembly module, which imports nothing."""

    def __init__(self, module):
        import wasmtime  # comes with an extra, beside the compiler

        self._store = wasmtime.Store()
        compiled = wasmtime.Module(self._store.engine, module)
        assert not compiled.imports
        self._exports = wasmtime.Instance(self._store, compiled, []).exports(self._store)
        self._memory: Any = self._exports["memory"]
        self.call("_initialize")

    def call(self, name, *values):
        function: Any = self._exports[name]
        return function(self._store, *values)

    def read(self, address, size):
        return bytes(self._memory.read(self._store, address, address + size))

    def write(self, address, data):
        self._memory.write(self._store, data, address)


class Page:
    """What engine.js does: `settings` are values by path in their order, `place` finds a column, `names` objectives."""

    def __init__(self, machine, settings, place, names):
        self._machine, self._settings, self._place, self._names = machine, settings, place, names
        machine.call("set_up")
        self.lanes = machine.call("lane_count")

    def fly(self, runs, columns):
        """The hash of the rows, the outcome, the time and the objectives of each run; or why they are refused."""
        call, read, settings = self._machine.call, self._machine.read, self._settings
        for lane, values in enumerate(runs):
            assert set(values) <= set(settings)
            for i, (path, start) in enumerate(settings.items()):
                value = values.get(path, start)
                row = struct.pack("<dqq", float(value), *decimal_of(value))
                self._machine.write(call("settings_of", lane) + 24 * i, row)
        call("record_columns", len(columns))
        for i, column in enumerate(columns):
            call("record_at", i, *map(int, self._place(column)))
        if not call("fly", len(runs), 1):
            return call("refused_reason"), [*settings][call("refused_setting")]
        outcomes, times, counts = (
            struct.unpack(f"<{self.lanes}q", read(call(name), 8 * self.lanes))
            for name in ("outcomes", "outcome_times", "row_counts")
        )
        names = self._names
        values = np.frombuffer(read(call("values_of_objectives"), 8 * self.lanes * len(names)))
        values = values.reshape(len(names), self.lanes)
        return [
            (hashed(read(call("rows_of", lane), 8 * counts[lane] * (len(columns) + 1))), outcomes[lane], times[lane],
             dict(zip(names, values[:, lane].tolist())))
            for lane in range(len(runs))
        ]  # fmt: skip


def hashed(data):
    """SHA-256 of rows."""
    return hashlib.sha256(data).hexdigest()


def hashes_of(flights, columns):
    """Those of the rows of `fly`."""
    rows = np.stack([flights[name] for name in ("time", *columns)], axis=-1)
    return [hashed(np.ascontiguousarray(each[~np.isnan(each[:, 0])]).tobytes()) for each in rows]
