"""The C of a system's expressions: expressions.h, which batch.c includes."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from orchestration.simulation.engines.batch.folds import Folds
from orchestration.simulation.engines.batch.writing import ExpressionWriter, Leaf, Section
from orchestration.systems.expressions.over_run import TIME
from orchestration.systems.expressions.syntax import Call, Name, Node


@dataclass(frozen=True, kw_only=True)
class ExpressionCode:
    """Expressions in C, and how their values follow from its final states."""

    text: str
    folds: Folds

    @property
    def states(self) -> Sequence[float]:
        """The initial value of each state."""
        return self.folds.writer.states


def expression_code(
    leaves: Mapping[str, Leaf],
    lines: Mapping[str, int],
    reductions: Mapping[Node, str],
    calls: Sequence[Call],
    condition: Node | None,
    *,
    connections: Sequence[str],
    observed: Collection[int],
) -> ExpressionCode:
    """The C for reductions and the condition of divergence over `leaves`.

    `lines` are the connections of signals that are extrapolated linearly, by signal; `reductions` the C of those inside
    others; `observed` the components in continuous time that the reductions read. Raises `UsageError` for expressions
    that cannot be evaluated.
    """
    writer = ExpressionWriter(leaves, reductions)
    time = writer.before(Name(TIME))
    folds = Folds(writer)
    for call in calls:
        folds.add(call)
    after = _Slopes(writer, lines)
    watched = Section("w")
    over = "q_known(0)" if condition is None else writer.truth(condition, "row", watched)
    rows = folds.rows[None]
    sampled: list[str] = []
    for connection, each in folds.rows.items():
        if connection is None:
            continue
        marks = f"now->marks[{connections.index(connection)}]"
        sampled += [f"if ({marks}) {{", f"const q_mask some = m & mask_of({marks});"]
        sampled += [*each.section.lines, *each.always, "}"]
    held = [*folds.held.always, *writer.remembered(writer.held), "}"]
    changed = ["if (!now->still) {", *writer.held.lines]
    constants = [f"AT(b->constants, {slot}) = {writer.value(node, 'row', writer.once)};"
                 for node, slot in writer.constants.items()]  # fmt: skip
    used = sorted({leaf.code.partition("(")[2].partition(",")[0] for leaf in leaves.values() if "SIGNAL" in leaf.code})
    known = [f"const double *const memory{i} = b->components[{i}].memory;" for i in used]
    known.append("const double *const constants_ = b->constants;")
    unused = [*(f"(void)memory{i};" for i in used), "(void)constants_;", "(void)t;"]
    here = [*known, "double *const state = b->state;", "const q_real t = now->t;",
            "q_mask doubtful = q_known(0);", *unused]  # fmt: skip
    done = [*writer.remembered(writer.now), "if (q_any(doubtful)) b->doubtful |= lanes_of(doubtful);", "return 1;"]
    step = [f"const q_real dt = q_select(m, t - {time}, q_all(0.0));"]
    any_observed = " || ".join(f"index == {i}" for i in sorted(observed)) or "0 * index"
    return ExpressionCode(
        text="\n".join([
            *_function("int is_observed(int64_t index)", [f"return {any_observed};"]),
            *_function("void constants(Loop *b)", [*writer.once.lines, *constants]),
            *_function("q_mask holds(const Loop *b, q_real t)", [*known, *unused, *watched.lines, f"return {over};"]),
            *_row("begin_row", [
                *here, *rows.section.lines, *rows.first, *rows.always, *changed, *folds.held.first, *held, *sampled,
                *after.first, *done,
            ]),
            *_row("next_row", [
                *here, *rows.section.lines, *step, *writer.step.lines, *rows.next, *rows.always, *changed,
                *folds.held.next, *held, *sampled, *after.next, *done,
            ]),
            *_function("void reductions(const Loop *b, double *values)", [
                "double *const state = b->state;", "(void)state;",
                *(f"AT(values, {i}) = {value};" for i, value in enumerate(folds.values.values())),
            ]),
        ]),
        folds=folds,
    )  # fmt: skip


class _Slopes:
    """The last value, its time, and the slope of signals that are extrapolated linearly."""

    def __init__(self, writer: ExpressionWriter, lines: Mapping[str, int]) -> None:
        self.first: list[str] = []
        self.next: list[str] = []
        for name, slope in writer.slopes.items():
            height, since, connection = writer.state(), writer.state(), lines[name]
            x = writer.value(Name(name), "row", writer.now)
            self.first += [f"{height} = q_select(m, {x}, {height});", f"{since} = q_select(m, t, {since});"]
            self.next += [
                "{", f"const q_mask some = m & mask_of(now->marks[{connection}]);",
                f"{slope} = q_select(some, ({x} - {height}) / (t - {since}), {slope});",
                f"{height} = q_select(some, {x}, {height});", f"{since} = q_select(some, t, {since});", "}",
            ]  # fmt: skip


def _row(name: str, lines: Sequence[str]) -> list[str]:
    return _function(f"int {name}(Loop *b, const Instant *now, q_mask m)", lines)


def _function(head: str, lines: Sequence[str]) -> list[str]:
    return [f"static {head} {{", *(f"    {line}" for line in lines), "}", ""]
