"""Writes the series into fmu_kit/compiler/runtime/mathematics.h: python -m docs.make_coefficients.

Each is the polynomial through a function at Chebyshev points, with 40 digits, its coefficients rounded to doubles.
"""

import re
from collections.abc import Callable
from pathlib import Path

from mpmath import binomial, chebyfit, factorial, mp, mpf

HEADER = Path(__file__).parent.parent / "fmu_kit" / "compiler" / "runtime" / "mathematics.h"

SERIES: dict[str, tuple[str, str, Callable[[int], mpf], tuple[float, float], int]] = {
    # name: what it is, its variable, its Taylor coefficients, range, number of coefficients
    "exp": ("(exp(r) - 1 - r - r^2 / 2) / r^3", "r", lambda k: 1 / factorial(k + 3), (-0.3472, 0.3472), 10),
    "log": ("(2 atanh(s) / s - 2) / s^2, z = s^2", "z", lambda k: mpf(2) / (2 * k + 3), (0.0, 0.02944), 7),
    "log5": ("1/5 + z/7 + z^2/9 + ...", "z", lambda k: mpf(1) / (2 * k + 5), (0.0, 0.02944), 8),
    "sin": ("(sin(r) / r - 1) / r^2, z = r^2", "z", lambda k: -((-1) ** k) / factorial(2 * k + 3), (0.0, 0.6174), 7),
    "cos": ("(cos(r) - 1 + z / 2) / z^2, z = r^2", "z", lambda k: (-1) ** k / factorial(2 * k + 4), (0.0, 0.6174), 6),
    "asin": (
        "(asin(s) / s - 1) / s^2, z = s^2",
        "z",
        lambda k: binomial(2 * k + 2, k + 1) / mpf(4) ** (k + 1) / (2 * k + 3),
        (0.0, 0.25),
        13,
    ),
    "atan": ("(atan(t) / t - 1) / t^2, z = t^2", "z", lambda k: -(mpf(-1) ** k) / (2 * k + 3), (0.0, 0.17158), 11),
}


def coefficients(taylor: Callable[[int], mpf], interval: tuple[float, float], count: int) -> list[float]:
    """The polynomial's coefficients, lowest power first."""
    terms = [taylor(k) for k in reversed(range(90))]
    return [float(c) for c in reversed(chebyfit(lambda z: mp.polyval(terms, z), interval, count))]


def horner(constants: list[float]) -> str:
    """c0 + w * (c1 + w * (...)) as C."""
    first, *others = constants
    return f"{first.hex()} + w * ({horner(others)})" if others else first.hex()


def function(name: str) -> str:
    """One series as a function in C."""
    what, variable, taylor, interval, count = SERIES[name]
    c = coefficients(taylor, interval, count)
    start = f"/* {what}. */\nQ_ONE q_real q_{name}_series(q_real {variable}) {{\n"
    square = f"    const q_real w = {variable} * {variable};\n"
    even, odd = (wrapped(f"const q_real {key} = {horner(part)};") for key, part in (("even", c[::2]), ("odd", c[1::2])))
    return f"{start}{square}{even}{odd}    return even + {variable} * odd;\n}}\n"


def wrapped(statement: str) -> str:
    """A statement as lines of at most 120 characters."""
    lines, line = [], "   "
    for word in statement.split(" "):
        if len(line) + 1 + len(word) > 118:
            lines.append(line)
            line = "       "
        line += " " + word
    return "\n".join([*lines, line]) + "\n"


def main() -> None:
    """Write the series between the two marks of the header."""
    mp.dps = 40
    text = HEADER.read_text(encoding="ascii")
    series = "\n".join(function(name) for name in SERIES)
    text, count = re.subn(r"(/\* series \*/\n).*?(/\* end of series \*/)", rf"\1\n{series}\n\2", text, flags=re.S)
    if count != 1:
        raise ValueError(f"{HEADER}: expected the marks of the series once, found them {count} times")
    HEADER.write_text(text, encoding="ascii")


if __name__ == "__main__":
    main()
