"""Functions of time as C: they are called with scalars whose operations are written down."""

from typing import Any

from fmu_kit.scalar import ScalarOps


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
