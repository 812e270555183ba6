"""Writes the page in which a system runs, offline, with the bits of its native FMUs."""

import gzip
import html
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from fmu_kit.new_files import write_atomically
from orchestration.components.fmi.read_description import Model, read_model
from orchestration.experiments.live.sliders import Slider, Sliders, parameters_without_ranges, usual_sliders
from orchestration.foundation.basics.errors import UsageError, expected_name
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.resolved import check_against_fmus, columns_of
from orchestration.simulation.engines.wasm.given_timing import reason
from orchestration.simulation.engines.wasm.modules import module_of
from orchestration.simulation.engines.wasm.settings import Setting
from orchestration.simulation.engines.wasm.tables_of_system import SystemTables, tables_of
from orchestration.simulation.requests.ranges import unit_at
from orchestration.simulation.requests.request import RequestLike, default_request, request_of
from orchestration.simulation.results.display_names import signal
from orchestration.simulation.results.objectives import GOOD
from orchestration.simulation.results.units import column_infos
from orchestration.systems.expressions.syntax import names, parse
from orchestration.systems.system.check import check, connect_references
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.files import located
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed, value_at, with_followers
from orchestration.systems.system.request import Request, errors_in_own_terms

SHIPPED = Path(__file__).with_name("paper_flight.html")
"""The page of the paper's flight, which a wheel has"""
_PAGE = resources.files("orchestration.experiments.live") / "page"
_PLACE = re.compile(r"\{\{(\w+)\}\}")
_LANES = {"single": 1, "pair": 2}
Ranges = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, kw_only=True, repr=False)
class Live:
    """A page in which a system runs."""

    html: str
    """The text of the file."""

    def save(self, path: str | Path) -> Path:
        """Write the file; raises `WriteError`."""
        write_atomically(Path(path), self.html)
        return Path(path)

    def _repr_html_(self) -> str:
        page = html.escape(self.html, quote=True)
        style = "width:100%;height:900px;border:0"
        return f'<iframe sandbox="allow-scripts" style="{style}" srcdoc="{page}"></iframe>'

    def __repr__(self) -> str:
        return f"<Live: {len(self.html.encode()) / 1000:.0f} kB; save(path) writes it>"


def live(
    request: RequestLike | None = None,
    vary: Ranges | None = None,
    map: tuple[str, str] | None = None,
    *,
    name: str | None = None,
) -> Live:
    """A page that runs a system, or a scenario, while a number is changed: one HTML file that needs no network.

    It has the bits of the native FMUs, whose C is compiled for WebAssembly. `vary` are ranges of numbers by path, as
    in a study (`timing.period`, `components.controller.sampling.period`); default: the timing, and parameters with a
    declared range. `map` are the two paths of its map. `name` is the file that commands in the page run; default:
    that of the request.

    Raises `UsageError` for what a page cannot run, naming it, `QuadcosimError` without the extra `live`.
    """
    loaded = default_request() if request is None else request_of(request)
    name = str(request) if name is None and isinstance(request, (str, Path)) else name
    with errors_in_own_terms(loaded):
        system = located(loaded.as_system())
        models = {
            each: read_model(Path(component.fmu), component.access) for each, component in system.components.items()
        }
        check(system, models)
        given = reason(connect_references(system, models))
        chosen = _chosen(loaded, system, models, vary, map, given)
        system = connect_references(_with_ends(loaded, system, chosen), models)
        fits = check_against_fmus(system, models)
        system = fits.system
        free = [path for slider in chosen.sliders for path in loaded.paths_of(slider.path)]
        tables = [_tables(system, models, lanes, free) for lanes in _LANES.values()]
        document = _document(loaded, tables[0], chosen, name, fits.units, given)
        modules = {each: module_of(table, table.shape.lanes) for each, table in zip(_LANES, tables)}
    return Live(html=_as_html(document, modules))


# -- what varies -----------------------------------------------------------------------------------------------------


def _chosen(
    request: Request, system: System, models: Mapping[str, Model], vary: Ranges | None,
    axes: tuple[str, str] | None, given: str | None,
) -> Sliders:  # fmt: skip
    """The sliders that are asked for; raises `UsageError` for a path that has no number or an empty range."""
    usual = usual_sliders(request, system, models)
    sliders = [each for each in usual.sliders if _is_there(request, models, each.path)]
    if given:
        sliders = [each for each in sliders if all(".parameters." in path for path in request.paths_of(each.path))]
        sliders = sliders or parameters_without_ranges(system, models)
    if vary is not None:
        words = {each.path: each for each in usual.sliders}
        sliders = []
        for path, (low, high) in vary.items():
            if not low < high:
                raise UsageError(f"vary {path} = {low:g}:{high:g}: expected LOW:HIGH, the first smaller")
            known = words.get(path, Slider(path=path, words=path, low=low, high=high))
            is_log = known.logarithmic and low > 0.0
            sliders.append(replace(known, low=float(low), high=float(high), logarithmic=is_log))
    for each in sliders:
        _paths(request, system, each.path)
    chosen = axes if axes is not None else usual.map
    listed = [each.path for each in sliders]
    if chosen is not None and not set(chosen) <= set(listed):
        if axes is not None:
            wrong = next(path for path in axes if path not in listed)
            raise UsageError(f"map {wrong}: {expected_name(wrong, listed)}, a path that varies")
        chosen = (listed[0], listed[1]) if len(listed) > 1 else None
    return Sliders(sliders=sliders, map=chosen, measure=usual.measure)


def _is_there(request: Request, models: Mapping[str, Model], target: str) -> bool:
    """Whether the parameter of a target, if it is one, is one of an FMU."""
    for path in request.paths_of(target):
        owner, is_parameter, name = path.removeprefix("components.").partition(".parameters.")
        if is_parameter and name not in models[owner].variables:
            return False
    return True


def _paths(request: Request, system: System, target: str) -> tuple[str, ...]:
    paths = request.paths_of(target)
    for path in paths:
        value = value_at(system, path)
        if value is not None and (isinstance(value, bool) or not isinstance(value, (int, float))):
            raise UsageError(f"vary {target}: expected the path of a number")
    return paths


def _with_ends(request: Request, system: System, chosen: Sliders) -> System:
    """The system with what is to vary switched on where it is off: a delay of 0 has another structure."""
    changes = {}
    for slider in chosen.sliders:
        for path in request.paths_of(slider.path):
            if path.startswith("connections.") and not value_at(system, path) and not slider.low <= 0.0 <= slider.high:
                changes[path] = slider.low
    return changed(system, changes) if changes else system


# -- what a page may set ---------------------------------------------------------------------------------------------

_SWITCHES = ("delay", "delay_jitter", "loss", "scale", "offset")


def _tables(system: System, models: Mapping[str, Model], lanes: int, free: Sequence[str]) -> SystemTables:
    """The tables of a system; settings that would change its structure stay on their side of zero."""
    tables = tables_of(Shape(system=system, models=models, lanes=lanes), free=free)
    base = _structure(system, models, tables)
    limited = list(tables.settings.all)
    for x in system.connections:
        keys: list[tuple[str, list[str]]] = [(key, [f"connections.{x.name}.{key}"]) for key in _SWITCHES]
        for what in ("noise", "quantisation"):
            keys.append((what, [p for p in tables.settings.at if p.startswith(f"connections.{x.name}.{what}.")]))
        for key, paths in keys:
            if not set(paths) <= set(tables.settings.at):
                continue
            neutral = 1.0 if key == "scale" else 0.0
            values = {path: limited[tables.settings.at[path]].value for path in paths}
            is_off = all(value == neutral for value in values.values())
            other = changed(system, dict.fromkeys(paths, 0.25 if is_off else neutral))
            if _structure(other, models, tables) == base:
                continue
            for path in paths:
                place = tables.settings.at[path]
                limited[place] = _on_its_side(limited[place], neutral, is_off)
    tables.settings.all[:] = limited
    return tables_of(tables.shape, tables.settings)


def _structure(system: System, models: Mapping[str, Model], tables: SystemTables) -> tuple[Any, ...]:
    """All in the tables that a setting of a connection may change but its value."""
    shape = replace(tables.shape, system=system)
    wires, plan = shape.wires, shape.wires.plan
    return (
        plan.continuous, plan.sampled, plan.posted, plan.measured, plan.wires, plan.read_ahead,
        [(any(x.noise.values()), any(x.quantisation.values()), x.converts) for x in system.connections],
        [wires.into(name) for name in shape.names],
    )  # fmt: skip


def _on_its_side(setting: Setting, neutral: float, is_off: bool) -> Setting:
    if is_off:
        return replace(setting, low=neutral, high=neutral)
    return replace(setting, excludes_low=True) if setting.low == neutral else setting


# -- the page --------------------------------------------------------------------------------------------------------


def _document(
    request: Request, tables: SystemTables, chosen: Sliders, name: str | None, units: Mapping[str, str],
    given: str | None,
) -> dict[str, Any]:  # fmt: skip
    shape, at = tables.shape, tables.settings.at
    system, models = shape.system, shape.models
    targets = {}
    for path in at:
        own = request.in_own_terms(path)
        try:
            paths = request.paths_of(own)
        except UsageError:
            paths = ()
        if own != path and path in paths and all(each in at for each in paths):
            targets[own] = [at[each] for each in paths]
    sliders = []
    for each in chosen.sliders:
        paths = with_followers(system, request.paths_of(each.path))
        missing = [path for path in paths if path not in at]
        if missing:
            why = f"; {given}, so its timing is that of the file" if given else ""
            raise UsageError(f"vary {each.path}: expected a number that a page can set{why}")
        targets[each.path] = [at[path] for path in paths]
        value = tables.settings.all[at[paths[0]]].value
        sliders.append({
            "path": each.path, "words": each.words, "group": each.group, "low": each.low, "high": each.high,
            "log": each.logarithmic, "whole": each.whole, "value": value, "unit": unit_at(paths[0], models) or "",
        })  # fmt: skip
    columns = [column for column in columns_of(system)[1:] if component_of(column) in system.components]
    described = column_infos(system, models, ("time", *columns))
    seen = [signal for signals in shape.seen.values() for signal in signals]
    return {
        "title": request.headline() or (name or "a system"), "name": name, "kind": request.kind,
        "settings": [[s.path, s.value, s.low, s.high, int(s.excludes_low)] for s in tables.settings.all],
        "targets": targets, "sliders": sliders, "map": chosen.map, "measure": _measure(system, chosen),
        "names": {column: signal(column, described) for column in columns},
        "columns": [[column, *map(int, shape.place(column)), described[column].unit or ""] for column in columns],
        "seen": seen, "objectives": [*shape.nodes], "good": [*shape.nodes].index(GOOD) if GOOD in shape.nodes else -1,
        "units": dict(units), "fixed": given and f"{given}: the timing is that of the file, and has no sliders",
        "span": max((30.0 * c.sampling.period for c in system.components.values() if c.sampling), default=1.0),
        "optional": [*system.optional], "outcomes": [*system.criterion.outcomes],
        "components": [*shape.names], "connections": [[x.name, x.sender, x.receiver] for x in system.connections],
        "sampled": [shape.names[i] for i in shape.wires.sampled],
    }  # fmt: skip


def _measure(system: System, chosen: Sliders) -> str | None:
    """The objective that decides whether a run is good, which the map shows."""
    named = [] if system.criterion.good is None else names(parse(system.criterion.good))
    return chosen.measure or next((name for name in named if name in system.objectives), None)


_CHARACTERS = np.array([x for x in range(33, 127) if chr(x) not in "&<>"], dtype=np.uint8)
"""Characters of packed content: two of the 91 have 13 bits"""


def _packed(content: bytes) -> str:
    """The attributes and the text of an element with content, which page.html unpacks: shorter than in base 64."""
    packed = gzip.compress(content, 9, mtime=0)
    bits = np.unpackbits(np.frombuffer(packed, dtype=np.uint8), bitorder="little")
    groups = np.pad(bits, (0, -len(bits) % 13)).reshape(-1, 13) @ (1 << np.arange(13))
    characters = _CHARACTERS[np.column_stack([groups // 91, groups % 91])]
    return f'data-size="{len(packed)}">{characters.tobytes().decode()}'


def _as_html(document: Mapping[str, Any], modules: Mapping[str, bytes]) -> str:
    text = json.dumps(document, separators=(",", ":"), allow_nan=False)
    parts = {
        "title": html.escape(str(document["title"])), "style": _text("style.css"),
        "script": _packed(_text("page.js").encode()),
        "system": _packed(text.encode()), "engine": _packed((_text("engine.js") + _text("worker.js")).encode()),
        **{each: _packed(module) for each, module in modules.items()},
    }  # fmt: skip
    return _PLACE.sub(lambda place: parts[place[1]], _text("page.html"))


def _text(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")


def ranges_of(texts: Sequence[str]) -> dict[str, tuple[float, float]] | None:
    """Ranges of `PATH=LOW:HIGH`; None for none. Raises `UsageError` for anything else."""
    found = {}
    for text in texts:
        path, _, span = text.partition("=")
        low, _, high = span.partition(":")
        try:
            found[path] = float(low), float(high)
        except ValueError:
            raise UsageError(f"--vary {text}: expected PATH=LOW:HIGH") from None
    return found or None
