"""The values of sources over time as C, which engines/sources.py computes in Python."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fmu_kit.scalar import ScalarOps
from fmu_kit.trajectory import Trajectory
from orchestration.components.fmi.kit import TRAJECTORY
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.resolved import table_of
from orchestration.simulation.engines.wasm.settings import Settings
from orchestration.systems.schedule.streams import VALUE, Streams
from orchestration.systems.signals.library import make_signal
from orchestration.systems.system.connection import MOTION, Source


def key_text(key: Sequence[int]) -> str:
    """The C of the key of a stream."""
    return f"{{{{{', '.join(f'{word}u' for word in key)}}}, {len(key)}}}"


def numbers_text(values: Any) -> str:
    """The C of numbers."""
    return ", ".join(number_text(value) for value in np.asarray(values, dtype=float).ravel().tolist()) or "0"


def number_text(value: float) -> str:
    """The C of a number."""
    if math.isnan(value):
        return '__builtin_nan("")'
    return repr(value) if math.isfinite(value) else "-__builtin_inf()" if value < 0.0 else "__builtin_inf()"


class SourcesInC:
    """Writes the sources of a system: functions of time, and what is drawn for them."""

    def __init__(self, shape: Shape, settings: Settings) -> None:
        """Raises `UsageError` for a source that cannot be written."""
        self._shape, self._settings, self._system = shape, settings, shape.system
        self._streams = Streams(0, self._system.streams)
        self.drawn: list[str] = []
        """rows of `drawn_table`"""
        self._set_out: list[str] = []
        self._rewind: list[str] = []
        self._functions: list[str] = []
        self._known: dict[str, int] = {}
        fed = [name for name, source in self._system.sources.items() if source.to]
        self.width = sum(len(self._system.sources[name].to) for name in fed)
        given, seen = self._calls(fed), self._calls([*shape.seen])
        head = "int lane, const Setting *s, int64_t time, double *into"
        unused = "(void)lane, (void)s, (void)time, (void)into;"
        count = len(self.drawn)
        self.text = "\n".join([
            f"static Held held[L][{count + 1}];", *self._functions,
            f"static void seen_at({head}) {{ {unused} {seen} }}",
            f"static void given_at({head}) {{ {unused} {given} }}",
            "static int set_out_sources(int lane, const Setting *s) {", "    (void)lane, (void)s;",
            *(f"    {line}" for line in self._set_out), "    return 1;", "}",
            "static void rewind_sources(int lane) {", "    (void)lane;", *(f"    {line}" for line in self._rewind), "}",
        ])  # fmt: skip

    def _calls(self, names: Sequence[str]) -> str:
        place, calls = 0, []
        for name in names:
            if name not in self._known:
                self._known[name] = len(self._known)
                self._write(name, self._system.sources[name])
            calls.append(f"source{self._known[name]}(lane, s, time, into + {place});")
            place += len(self._system.sources[name].signals(name))
        return " ".join(calls)

    def _setting(self, name: str, key: str) -> int:
        return self._settings.at[f"sources.{name}.{key}"]

    def _write(self, name: str, source: Source) -> None:
        lines, before = self._lines(name, source), ["(void)lane, (void)s, (void)time;"]
        if source.scale != 1.0:
            width = len(source.signals(name))
            lines.append(
                f"for (int k = 0; k < {width}; k++) into[k] = s[{self._setting(name, 'scale')}].value * into[k];"
            )
        head = f"static void source{self._known[name]}(int lane, const Setting *s, int64_t time, double *into)"
        self._functions.append("\n".join([f"{head} {{", *(f"    {line}" for line in (*before, *lines)), "}"]))

    def _lines(self, name: str, source: Source) -> list[str]:
        if source.constant is not None:
            return [f"for (int k = 0; k < {len(source.to)}; k++) into[k] = s[{self._setting(name, 'constant')}].value;"]
        if source.noise is not None:
            return self._noise(name, source)
        if source.is_built_in:
            return self._built_in(source)
        if source.signal is not None:
            signal = make_signal(source.signal, source.parameters)
            if not source.is_motion:
                raise UsageError(f"sources.{name}: expected no gusts in a page")
            return self._motion(name, source, signal)
        if source.is_motion:
            raise UsageError(f"sources.{name}: expected no way-points in a page")
        time, columns = table_of(source, self._system.stop_time)
        function = "on_step" if source.interpolation == "previous" else "on_line"
        return [
            f"static const double times[] = {{{numbers_text(time)}}};",
            f"static const double rows[] = {{{numbers_text(columns)}}};",
            f"{function}(times, rows, {len(time)}, {columns.shape[1]}, (double)time / NANOSECONDS, into);",
        ]

    def _drawn(self, name: str, period: int, width: int) -> int:
        key = key_text(self._streams.key(f"sources.{name}", VALUE))
        self.drawn.append(f"{{{period}, {width}, {key}}}")
        return len(self.drawn) - 1

    def _noise(self, name: str, source: Source) -> list[str]:
        period, width = self._setting(name, "period"), len(source.to)
        i = self._drawn(name, period, width)
        self._set_out += [
            f"if (!grid_of(NULL, s + {period}, NULL, held[lane][{i}].parts)) return 0;",
            f"int64_t rows{i} = (int64_t)(s[STOP_TIME_SETTING].value / s[{period}].value) + 3;",
            f"held[lane][{i}].rows = draw_source(lane, {i}, rows{i});",
            f"if (!held[lane][{i}].rows) return 0;",
        ]
        self._rewind.append(f"rewind_held(&held[lane][{i}]);")
        return [
            f"const double *row = held_row(&held[lane][{i}], {width}, time);",
            f"double sigma = __builtin_sqrt(s[{self._setting(name, 'noise')}].value / s[{period}].value);",
            f"for (int k = 0; k < {width}; k++) into[k] = sigma * row[k];",
        ]

    def _built_in(self, source: Source) -> list[str]:
        lines, fields = Lines(), dict[str, Any]()
        for name, field in TRAJECTORY.items():
            path = f"components.{source.trajectory}.parameters.{name}"
            variable = self._shape.models[source.trajectory or ""].variables.get(name)
            if path in self._settings.at:
                fields[field] = lines.named(f"s[{self._settings.at[path]}].value")
            elif variable is not None and variable.start is not None:
                fields[field] = float(variable.start)
        t = lines.named("(double)time / NANOSECONDS")
        position = Trajectory(**fields).position(t, lines.ops)
        return [*lines.lines, *(f"into[{k}] = {value};" for k, value in enumerate(position))]

    def _motion(self, name: str, source: Source, motion: Any) -> list[str]:
        lines = Lines()
        now = motion.at(lines.named("(double)time / NANOSECONDS"), lines.ops)
        values = [
            each for order in (now.position, now.velocity, now.acceleration, now.jerk, now.snap) for each in order
        ]
        quantities = [MOTION.index(".".join(signal.split(".")[-2:])) for signal in source.signals(name)]
        given = [f"into[{k}] = {_as_text(values[i])};" for k, i in enumerate(quantities)]
        return [*lines.lines, *given]


def _as_text(value: Any) -> str:
    return str(value) if isinstance(value, Text) else number_text(float(value))


class Lines:
    """Lines of C that compute numbers, each once."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._names: dict[str, str] = {}

    def named(self, code: str) -> "Text":
        """The number that some C computes."""
        if code not in self._names:
            self._names[code] = f"x{len(self._names)}"
            self.lines.append(f"const double {self._names[code]} = {code};")
        return Text(self, self._names[code])

    @property
    def ops(self) -> ScalarOps:
        """The functions of such scalars; those of mathematics are the kit's own, with the same bits everywhere."""

        def called(name: str) -> Any:
            return lambda x: self.named(f"ONE(q_{name}, {x})")

        def unknown(*values: Any) -> Any:
            raise NotImplementedError("a motion that is written as C has sin, cos, where and maximum")

        return ScalarOps(
            sqrt=called("sqrt"), tanh=called("tanh"), sin=called("sin"), cos=called("cos"), atan2=unknown,
            sign=unknown, all=unknown,
            maximum=lambda a, b: self.named(f"{_text(a)} > {_text(b)} ? {_text(a)} : {_text(b)}"),
            where=lambda condition, a, b: self.named(f"{condition} ? {_text(a)} : {_text(b)}"),
        )  # fmt: skip


class Text:
    """A number that C computes."""

    def __init__(self, lines: Lines, code: str) -> None:
        self._lines, self._code = lines, code

    def __str__(self) -> str:
        return self._code

    def _of(self, sign: str, first: Any, second: Any) -> "Text":
        return self._lines.named(f"{_text(first)} {sign} {_text(second)}")

    def __add__(self, other: Any) -> "Text":
        return self._of("+", self, other)

    def __radd__(self, other: Any) -> "Text":
        return self._of("+", other, self)

    def __sub__(self, other: Any) -> "Text":
        return self._of("-", self, other)

    def __rsub__(self, other: Any) -> "Text":
        return self._of("-", other, self)

    def __mul__(self, other: Any) -> "Text":
        return self._of("*", self, other)

    def __rmul__(self, other: Any) -> "Text":
        return self._of("*", other, self)

    def __truediv__(self, other: Any) -> "Text":
        return self._of("/", self, other)

    def __rtruediv__(self, other: Any) -> "Text":
        return self._of("/", other, self)

    def __neg__(self) -> "Text":
        return self._lines.named(f"-{self}")

    def __gt__(self, other: Any) -> str:
        return f"{self} > {_text(other)}"

    def __lt__(self, other: Any) -> str:
        return f"{self} < {_text(other)}"


def _text(value: Any) -> str:
    return str(value) if isinstance(value, Text) else repr(float(value)) if value >= 0.0 else f"({float(value)!r})"
