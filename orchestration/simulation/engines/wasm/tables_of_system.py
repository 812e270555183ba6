"""The tables of a system as C: timing.h and system.h, which timing.c and live.c include."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from orchestration.components.fmi.instance import number_of
from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.batch.writing import ExpressionWriter
from orchestration.simulation.engines.wasm import normal_numbers
from orchestration.simulation.engines.wasm.given_timing import GivenTiming, reason
from orchestration.simulation.engines.wasm.settings import Settings
from orchestration.simulation.engines.wasm.sources_in_c import SourcesInC, key_text, number_text, numbers_text
from orchestration.systems.expressions.over_run import reductions
from orchestration.systems.expressions.syntax import Call, Node, names_job_measure
from orchestration.systems.schedule.common_timetable import CommonTimetable
from orchestration.systems.schedule.streams import (
    DELAY,
    DELAY_JITTER,
    HIGHEST,
    JITTER,
    LOSS,
    LOWEST,
    NOISE,
    Streams,
)
from orchestration.systems.system.choices import Spread
from orchestration.systems.system.connection import component_of, variable_of

_TABLES = {"exchanged": 0, "posted": 1, "measured": 2}
MOST_INSTANTS = 2**20
"""Most instants and messages of a run in a page"""


@dataclass(frozen=True, kw_only=True)
class SystemTables:
    """A system in C."""

    shape: Shape
    settings: Settings
    timing: str
    system: str


def tables_of(shape: Shape, settings: Settings | None = None, free: Collection[str] = ()) -> SystemTables:
    """The tables of a system, with these settings if they are known; `free` as `Settings` has it.

    Raises `UsageError`, naming it, for what a page cannot have.
    """
    system = shape.system
    for name, component in system.components.items():
        if component.sampling is not None and component.sampling.clock == "fmu":
            raise UsageError(f"components.{name}.sampling.clock = fmu: expected master in a page")
    given = GivenTiming(shape) if reason(system) else None
    settings = settings or Settings(system, shape.models, free, timing_is_given=given is not None)
    if given is not None and given.size > MOST_INSTANTS:
        raise UsageError(f"a page has room for {MOST_INSTANTS} instants and messages; this run has {given.size}")
    sources = None if given else SourcesInC(shape, settings)
    return SystemTables(
        shape=shape, settings=settings, timing=_timing(shape, settings, sources, given),
        system=_system(shape, settings, sources, given),
    )  # fmt: skip


def _ints(name: str, values: Iterable[int]) -> str:
    return f"static const int64_t {name}[] = {{{', '.join(str(int(v)) for v in values) or '0'}}};"


def _table(kind: str, name: str, rows: Sequence[str]) -> str:
    listed = ",\n    ".join(rows) or "{0}"
    return f"static const {kind} {name}[] = {{\n    {listed}}};"


# -- timing ------------------------------------------------------------------------------------------------------------


def _timing(shape: Shape, settings: Settings, sources: SourcesInC | None, given: GivenTiming | None) -> str:
    system, at = shape.system, settings.at
    common, streams = CommonTimetable(system, {}), Streams(0, system.streams)
    plan, connections, names = common.plan, system.connections, [*system.components]
    lines, routes, clocks = [], [], []
    for i, x in enumerate(connections):
        place, keys = f"connections.{x.name}", (DELAY, DELAY_JITTER, LOSS, NOISE)
        routes.append(
            f"{{{common.place[common.sender[i]]}, {common.place[common.receiver[i]]}, {int(x.order == 'jacobi')}, "
            f"{int(i in plan.read_ahead)}, {at.get(f'{place}.delay', -1)}, {at.get(f'{place}.delay_jitter', -1)}, "
            f"{at.get(f'{place}.loss', -1)}, {at.get(f'{place}.burst_length', -1)}, "
            f"{_is_normal(x.jitter_distribution)}, "
            f"{', '.join(key_text(streams.key(place, key)) for key in keys)}, "
            f"{len(x.start)}, {int(any(x.noise.values()))}, {_TABLES[shape.wires.table(i)]}}}"
        )
    for k, name in enumerate(() if given else plan.sampled):
        place, sampling = f"components.{name}", system.components[name].sampling
        assert sampling is not None
        incoming = [i for i in plan.measured if connections[i].receiver == name]
        outgoing = [i for i in plan.commanded if connections[i].sender == name]
        lines += [_ints(f"incoming{k}", incoming), _ints(f"outgoing{k}", outgoing)]
        of = ", ".join(str(at[f"{place}.sampling.{key}"]) for key in ("period", "offset", "jitter", "clock_ratio"))
        clocks.append(
            f"{{{names.index(name)}, {of}, {_is_normal(sampling.jitter_distribution)}, "
            f"{key_text(streams.key(place, JITTER))}, incoming{k}, outgoing{k}, {len(incoming)}, {len(outgoing)}}}"
        )
    posts = (
        []
        if given
        else [
            f"{{{j}, {at[f'components.{names[i]}.step']}}}"
            for i in common.points
            for j in plan.posted
            if common.sender[j] == i
        ]
    )
    points = (
        []
        if given
        else [f"{{{at[f'components.{names[i]}.step']}, 0, {1 << int(common.place[i])}u}}" for i in common.points]
    )
    for name, source in system.sources.items():
        if source.period is not None and not given:
            places = {int(common.place[names.index(component_of(end))]) for end in source.to} - {-1}
            points.append(f"{{{at[f'sources.{name}.period']}, 1, {sum(1 << place for place in places)}u}}")
    drawn = sources.drawn if sources else []
    has_normals = bool(drawn) or any(any(x.noise.values()) for x in connections)
    counts = {
        "ROUTES": len(routes), "CLOCKS": len(clocks), "POSTS": len(posts), "POINTS": len(points),
        "DRAWN": len(drawn), "CONTINUOUS": len(common.continuous), "STOP_TIME_SETTING": at["stop_time"],
        "SEED_SETTING": at["seed"],
    }  # fmt: skip
    return "\n".join([
        "#include <math.h>", f"#define TIMING_IS_GIVEN {int(given is not None)}",
        f"#define NORMALS {int(has_normals)}", f"#define LOWEST {LOWEST!r}",
        f"#define HIGHEST {HIGHEST!r}", f"#define MOST_INSTANTS {MOST_INSTANTS}.0",
        f"enum {{ {', '.join(f'{name} = {value}' for name, value in counts.items())} }};", *lines,
        _table("RouteTable", "route_table", routes), _table("ClockTable", "clock_table", clocks),
        _table("PostTable", "post_table", posts), _table("PointsTable", "points_table", points),
        _table("DrawnTable", "drawn_table", drawn), normal_numbers.tables() if has_normals else "",
        given.timing if given else "", "",
    ])  # fmt: skip


# -- components, connections, expressions ------------------------------------------------------------------------------


def _is_normal(spread: Spread) -> int:
    match spread:
        case "uniform":
            return 0
        case "normal":
            return 1


def _system(shape: Shape, settings: Settings, sources: SourcesInC | None, given: GivenTiming | None) -> str:
    system, at, wires, names = shape.system, settings.at, shape.wires, shape.names
    lines = ["#define DECLARED " + " ".join(f"DECLARE(c{i})" for i in range(len(names))), "DECLARED"]
    components = [_component(i, shape, settings, lines) for i in range(len(names))]
    connections = [_connection(i, shape, settings, lines) for i in range(len(system.connections))]
    groups = []
    for i, group in enumerate(shape.first_exchange):
        lines.append(_ints(f"group{i}", group))
        groups.append(f"{{group{i}, {len(group)}}}")
    parameters = []
    for path, place in at.items():
        owner, is_parameter, variable = path.removeprefix("components.").partition(".parameters.")
        if path.startswith("components.") and is_parameter:
            reference = shape.models[owner].variables[variable].reference
            parameters.append(f"{{{names.index(owner)}, {reference}, {place}}}")
    zeros = []
    for name, component in system.components.items():
        for key in (SAMPLE_PERIOD, SAMPLE_OFFSET):
            if component.sampling is not None and shape.models[name].has_clock:
                zeros.append(f"{{{names.index(name)}, {shape.models[name].variables[key].reference}}}")
    allowed = [
        f"{{{number_text(s.low)}, {number_text(s.high)}, {int(s.excludes_low)}, {int(s.is_whole)}}}"
        for s in settings.all
    ]
    bursts = [
        f"{{{at[f'connections.{x.name}.loss']}, {at[f'connections.{x.name}.burst_length']}}}"
        for x in system.connections
        if f"connections.{x.name}.burst_length" in at
    ]
    named = [_named(name, shape, settings, given) for name in shape.numbers]
    calls = [*shape.calls]
    own = [*shape.expressions.folds.values]
    inner = [own.index(shape.calls[call]) for call in shape.inner]
    most = max(len(shape.read(name)) for name in names)
    counts = {
        "COMPONENTS": len(names), "CONNECTIONS": len(connections), "GROUPS": len(groups), "SETTINGS": len(settings.all),
        "PARAMETERS": len(parameters), "OWN_CLOCKS": len(zeros), "NAMED": len(named), "INNER": len(inner),
        "NUMBERS": len(named) + 1 + len(inner), "STATES": len(shape.expressions.states), "REDUCTIONS": len(own),
        "OBJECTIVES": len(shape.nodes), "PASSES": shape.passes, "SEEN_COUNT": shape.seen_count,
        "CONSTANTS_COUNT": len(shape.expressions.folds.writer.constants), "GIVEN_COUNT": shape.given_count,
        "GIVEN_ALL": sources.width if sources else 0, "CONTINUOUS_COUNT": len(wires.continuous),
        "SAMPLED_COUNT": len(wires.sampled),
        "SOME_BY_THEMSELVES": 0, "BURSTS_COUNT": len(bursts), "MOST_VARIABLES": most,
        "STOP_TIME_SETTING": at["stop_time"],
    }  # fmt: skip
    has_normals = bool(sources and sources.drawn) or any(any(x.noise.values()) for x in system.connections)
    return "\n".join([
        f"#define NORMALS {int(has_normals)}", f"#define TIMING_IS_GIVEN {int(given is not None)}",
        f"enum {{ {', '.join(f'{name} = {value}' for name, value in counts.items())} }};", *lines,
        _table("ComponentTable", "component_table", components),
        _table("ConnectionTable", "connection_table", connections), _table("GroupTable", "group_table", groups),
        _table("ParameterTable", "parameter_table", parameters),
        f"static const int32_t own_clocks[][2] = {{{', '.join(zeros) or '{0}'}}};",
        _table("Allowed", "allowed_settings", allowed),
        f"static const int32_t bursts[][2] = {{{', '.join(bursts) or '{0}'}}};",
        _ints("continuous_", wires.continuous), _ints("sampled_", wires.sampled), _ints("inner_reductions", inner),
        f"static const double first_states[] = {{{numbers_text(shape.expressions.states)}}};",
        _table("struct { int32_t setting; double value; }", "named_numbers", named),
        "static __attribute__((unused)) double number_at(int i, const Setting *s) {",
        "    return named_numbers[i].setting < 0 ? named_numbers[i].value : s[named_numbers[i].setting].value;", "}",
        sources.text if sources else given.sources if given else "", _finish(shape, calls, own), "",
    ])  # fmt: skip


def _component(i: int, shape: Shape, settings: Settings, lines: list[str]) -> str:
    name, wires = shape.names[i], shape.wires
    into, outputs = wires.into(name), shape.connected[name]
    every = [f"{{{source}, {place}}}" for source, place in shape.fed[name]]
    changing = every if shape.given_count else []
    lines += [
        _ints(f"outputs{i}", outputs), _ints(f"held{i}", into.held), _ints(f"ahead{i}", into.ahead),
        _ints(f"behind{i}", into.behind), _table("Fed", f"fed{i}", every),
        f"static const uint8_t read{i}[] = {{{', '.join(str(int(v)) for v in shape.read(name))}}};",
    ]  # fmt: skip
    sampled = i in wires.sampled
    ratio = settings.at[f"components.{name}.sampling.clock_ratio"] if sampled else -1
    return (
        f"{{COMPONENT(c{i}), outputs{i}, {len(outputs)}, {len(shape.read(name))}, {{held{i}, {len(into.held)}}}, "
        f"{{ahead{i}, {len(into.ahead)}}}, {{behind{i}, {len(into.behind)}}}, {wires.rank(i)}, 0, fed{i}, fed{i}, "
        f"{len(changing)}, {len(every)}, read{i}, {ratio}, {wires.rank(i) if sampled else -1}, "
        f"{int(name in shape.waits)}}}"
    )


def _connection(i: int, shape: Shape, settings: Settings, lines: list[str]) -> str:
    x, ends, names = shape.system.connections[i], shape.ends[i], shape.names
    lines += [
        _ints(f"start_of{i}", ends.start), _ints(f"end_of{i}", ends.end), _ints(f"kinds_of{i}", ends.kinds),
        f"static const double low_of{i}[] = {{{numbers_text(ends.low)}}};",
        f"static const double high_of{i}[] = {{{numbers_text(ends.high)}}};",
    ]  # fmt: skip
    plain = not x.converts and x.hold == "zero"
    place = f"connections.{x.name}"
    first = variable_of(x.start[0])
    of = [settings.at[f"{place}.{key}"] for key in (f"noise.{first}", f"quantisation.{first}", "scale", "offset")]
    flags = (plain, plain and not ends.kinds.any(), any(x.noise.values()), any(x.quantisation.values()), x.converts,
             x.hold == "first", i in shape.wires.plan.read_ahead)  # fmt: skip
    return (
        f"{{{names.index(x.sender)}, {names.index(x.receiver)}, start_of{i}, end_of{i}, kinds_of{i}, low_of{i}, "
        f"high_of{i}, {len(ends.start)}, {', '.join(str(int(flag)) for flag in flags)}, {', '.join(map(str, of))}, "
        f"{_TABLES[shape.wires.table(i)]}}}"
    )


def _named(name: str, shape: Shape, settings: Settings, given: GivenTiming | None) -> str:
    if given and names_job_measure(name):
        return f"{{-1, {number_text(given.number(shape, name))}}}"
    owner, variable = component_of(name), shape.models[component_of(name)].variables[variable_of(name)]
    path = f"components.{owner}.parameters.{variable.name}"
    if path in settings.at:
        return f"{{{settings.at[path]}, 0.0}}"
    return f"{{-1, {number_text(float(number_of(variable, variable.start)))}}}"


def _finish(shape: Shape, calls: Sequence[Call], own: Sequence[Call]) -> str:
    """The C of the values of objectives from those of reductions."""
    folds, place = shape.expressions.folds, {call: own.index(shape.calls[call]) for call in calls}
    lines = ["(void)b, (void)reduced_, (void)into;"]
    for call in calls:
        if call.function == "growth_share":
            key = shape.calls[call]
            value, none = _value(call.arguments[1], shape, place, lines, f"g{place[call]}_")
            lines += [
                "{", "double low[L] __attribute__((aligned(64))), steps[L] __attribute__((aligned(64)));",
                f"q_real count = READ(b->state, {folds.steps[key]});",
                f"AT(low, 0) = q_select({none}, q_all(__builtin_nan(\"\")), {value});",
                f"grown(b, {folds.kept[key]}, low, steps);",
                f"AT(reduced_, {place[call]}) = q_select(q_gt(count, 0.0) & q_not({none}), READ(steps, 0) / count, "
                "q_all(__builtin_nan(\"\")));", "}",
            ]  # fmt: skip
    for i, node in enumerate(shape.nodes.values()):
        value, none = _value(node, shape, place, lines, f"o{i}_")
        lines.append(f'AT(into, {i}) = q_select({none}, q_all(__builtin_nan("")), {value});')
    text = "\n".join(f"    {line}" for line in lines)
    return f"static void finish(Loop *b, double *reduced_, double *into) {{\n{text}\n}}"


def _value(node: Node, shape: Shape, place: Mapping[Call, int], lines: list[str], prefix: str) -> tuple[str, str]:
    """The C of an expression of reductions, and of the mask of lanes in which one of them has no value."""
    writer = ExpressionWriter(shape.leaves, {call: f"READ(reduced_, {i})" for call, i in place.items()})
    writer.once = type(writer.once)(prefix)
    value = writer.value(node, "row", writer.once)
    lines += writer.once.lines
    used = [f"READ(reduced_, {place[call]})" for call in reductions(node) if call in place]
    none = " | ".join(f"q_not(q_isfinite({each}))" for each in used) or "q_known(0)"
    return value, f"({none})"
