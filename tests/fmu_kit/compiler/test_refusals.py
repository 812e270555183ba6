"""What slaves to be compiled to C may not do: one line names it, its place, and what was expected."""

import re
from pathlib import Path

import pytest

from fmu_kit.bundle import PackagingError, Target
from fmu_kit.compiler.pack import building
from fmu_kit.compiler.pack.building import build
from fmu_kit.compiler.trace.errors import TraceError

SLAVE = """\
import math
import random
import time
from collections import deque

from fmu_kit.errors import require
from fmu_kit.interface import Input, Output
from fmu_kit.scalar import repeat
from fmu_kit.slave import Slave


def careful(x):
    try:
        return 1.0 / x
    except ZeroDivisionError:
        return 0.0


class Helper:
    def __init__(self, value):
        self.value = value


class Refused(Slave):
    description = "Refused."
    a = Input("A number.", None)
    y = Output("A number.", None)
    count = Output("A whole number.", None, 0)
    hidden = 0.0

    def initialise(self, t):
        self._kept = 0.0
        {initialise}

    def _changing(self, x):
        self._kept += x
        return x > 1.0

    def _speaking(self, x):
        if x > 1.0:
            self.warn_once("large", "x is large")
        return x > 1.0

    def _filling(self, given):
        for i in range(len(given)):
            given[i] += 1.0

    def _adding(self, given):
        given["new"] = 1.0
        return 1.0

    def _moving(self, helper):
        helper.value = 2.0

    def step(self, t, h):
        a = self.a
        {step}
"""
IN_A_STEP = [
    (
        "kept = [a, a]; self._filling(kept); self.y = kept[0]",
        "_filling changes its argument given: expected it to",
    ),
    ("kept = {}; self._adding(kept); self.y = kept['new']", "_adding changes its argument given: expected it to"),
    (
        "kept = Helper(a); self._moving(kept); self.y = kept.value",
        "_moving changes its argument helper: expected",
    ),
    ("self.y = '{}'.isdigit() + math.hypot(a, 1.0)", "a function that takes floats only was given a computed"),
    ("self.y = round(a)", "round() of a computed value: expected math.floor or math.ceil"),
    ("self.y = int(a)", "int() of a computed float: expected math.floor or math.ceil"),
    ("for k in range(math.floor(a)): self.y = k", "expected fmu_kit.scalar.repeat for a loop"),
    ("self.y = (1.0, 2.0)[math.floor(a)]", "a computed value where an integer must be known"),
    ("self.y = {1.0: 2.0}.get(a, 3.0)", "as the key of a dictionary, in a set or in a cache: expected an if"),
    ("require(a > 1.0, 'a', f'{a:>10}', 'more')", "{value:>10} of a float in a text: expected {value} or a format as"),
    ("self.count = a", "count: expected a value of its type, found a float"),
    ("self.y = random.random()", "random.random(): expected what follows from the variables and from time"),
    ("self.y = time.time()", "time.time(): expected what follows from the variables and from time alone"),
    ("print(a)", "print(): expected self.warn_once"),
    ("self.log('a')", "self.log: expected self.warn_once"),
    ("self._new = a", "self._new is first set in a step: expected it set by initialise"),
    ("self.hidden = a", "self.hidden hides the one of its class: expected another name, set by initialise"),
    ("self._kept = None", "self._kept changes in a step in more than numbers: self._kept is a number and None"),
    ("self._kept = [a]", "self._kept changes in a step in more than numbers: "),
    ("if a > 1.0: self._kept = 'on'", "the state differs in more than numbers between two paths: "),
    ("self.y = min([a, t], key=abs)", "min() of computed values with key: expected values only"),
    ("self.y = None", "self.y = None: expected a number"),
    ("if a > 1.0: self.count = 'on'", "self.count = on: expected a number"),
    (
        "while a > 1.0: a = a / 2.0",
        "while: more than 200 rounds by a computed condition, expected fmu_kit.scalar.repeat",
    ),
    ("assert a > 1.0", "AssertionError"),
    ("self.y = repeat(math.floor(a), lambda i, x: (x, x), a)", "repeat: expected the body to return what it is"),
    (
        "self.y = repeat(math.floor(a), lambda i, x: setattr(self, 'y', i * x) or x, a)",
        "repeat: its body changes the slave",
    ),
    (
        "self.y = repeat(math.floor(a), lambda i, x: self._changing(x) * x, a)",
        "repeat: its body calls a method that changes the slave",
    ),
    ("self.y = any(self._speaking(x) for x in (a, t))", "any() of values of which a later one may fail"),
    ("self.y = all(self._changing(x) for x in (a, t))", "all() of values of which a later one may fail"),
    ("self.y = any(1.0 / x > 2.0 for x in (a, t, h))", "any() of values of which a later one may fail"),
]
ADDED_IFS = "self.y = sum(1.0 if a > k else 0.0 for k in range(9))"
IN_INITIALISE = [
    ("self._queue = deque([0.0])", "deque: expected numbers in tuples, lists, dictionaries and objects"),
    ("self._one = self._other = Helper(t)", "self._one and self._other are one Helper: expected separate objects"),
    ("self._one = Helper(t); self._all = {'b.c': [self._one]}", "self._one and self._all['b.c'][0] are one Helper"),
    ("raise ValueError(t)", "Refused.initialise always fails"),
]


def refusal(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> tuple[Path, str]:
    """The path of a module with this text, and the message that refuses it."""
    monkeypatch.syspath_prepend(folder)
    module = f"refused_{folder.name}"
    path = folder / f"{module}.py"
    path.write_text(text)
    with pytest.raises(PackagingError) as raised:
        build(Target(module, "Refused", folder), folder)
    return path, str(raised.value)


def line_of(path: Path, words: str) -> int:
    """Where words stand in a file."""
    return 1 + next(k for k, line in enumerate(path.read_text().splitlines()) if words in line)


@pytest.mark.parametrize(("statement", "words"), IN_A_STEP)
def test_what_a_step_may_not_do_is_said_in_a_line(
    statement: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = SLAVE.replace("{initialise}", "pass").replace("{step}", statement)
    path, message = refusal(tmp_path, monkeypatch, text)
    assert words in message
    assert "\n" not in message
    if not re.match(
        "Refused: (self.*(a step|its class)|the state.*a step|.*(between two paths|of its type))", message
    ):  # of the slave as a whole
        assert message.startswith(f"Refused: {path}, line {line_of(path, statement)}: ")


@pytest.mark.parametrize(("statement", "words"), IN_INITIALISE)
def test_what_may_not_be_kept_is_said_in_a_line(
    statement: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = SLAVE.replace("{initialise}", statement).replace("{step}", "self.y = a")
    _, message = refusal(tmp_path, monkeypatch, text)
    assert words in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("called", "where", "words"),
    [
        ("self.y = careful(a)", "    try:", "try: expected an if before what may fail"),
        ("self.y = self._careful(a)", "        try:  # mine", "try: expected an if before what may fail"),
    ],
)
def test_errors_that_are_caught_are_refused_where_they_are(
    called: str, where: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    method = """
    def _careful(self, x):
        try:  # mine
            return math.sqrt(x)
        except ValueError:
            return 0.0
"""
    text = SLAVE.replace("{initialise}", "pass").replace("{step}", called) + method
    path, message = refusal(tmp_path, monkeypatch, text)
    assert message == f"Refused: {path}, line {line_of(path, where)}: {words}"


def test_a_loop_without_an_end_is_refused_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    method = """
def halved(x):
    while True:
        x = 0.5 * x
        if x < 1.0:  # enough
            return x
"""
    text = SLAVE.replace("{initialise}", "pass").replace("{step}", "self.y = halved(a)") + method
    path, message = refusal(tmp_path, monkeypatch, text)
    assert message.startswith(f"Refused: {path}, line {line_of(path, '# enough')}: while: more than 200 rounds")


@pytest.mark.parametrize(
    ("limit", "statement", "words"),
    [
        ("tracing.MAX_SIZE", "self.y = sum(a * k for k in range(300))", r"6\d\d operations and statements, at most 5"),
        ("path_exploration.MAX_SIZE", ADDED_IFS, "line {line}: more than 50000 paths through all functions: "),
        ("path_exploration.MAX_PATHS", ADDED_IFS, "line {line}: more than 2000 paths through this function: "),
    ],
)
def test_what_would_take_minutes_to_compile_is_refused_by_its_size(
    limit: str, statement: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"fmu_kit.compiler.trace.{limit}", 500)
    text = SLAVE.replace("{initialise}", "pass").replace("{step}", statement)
    path, message = refusal(tmp_path, monkeypatch, text)
    assert re.search(words.format(line=line_of(path, statement)), message)
    assert message.endswith("expected a loop by fmu_kit.scalar.repeat, and methods for ifs that follow one another")
    assert "\n" not in message


def test_what_takes_long_to_compile_is_announced_by_its_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*given: object) -> None:
        raise TraceError("stopped before it is compiled")

    monkeypatch.setattr(building, "LONG", 100)
    monkeypatch.setattr(building, "c_sources", stop)
    text = SLAVE.replace("{initialise}", "pass").replace("{step}", "self.y = sum(a * k for k in range(300))")
    refusal(tmp_path, monkeypatch, text)
    assert re.match(
        r"# Refused: compiling 6\d\d operations and statements, which may take min", capsys.readouterr().out
    )


@pytest.mark.parametrize("name", ["get_real", "terminate", "_initialise"])
def test_a_slave_answers_to_fmi_by_its_base_class_only(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = SLAVE.replace("{initialise}", "pass").replace("{step}", "pass")
    _, message = refusal(tmp_path, monkeypatch, f"{text}\n    def {name}(self, *given):\n        pass\n")
    assert message == (
        f"Refused: Refused.{name}: expected derivatives, initialise, internal_state, next_jump, read_parameters, "
        "restore, step, to_xml only"
    )


def test_numpy_is_refused_where_it_is_imported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "import numpy\n" + SLAVE.replace("{initialise}", "pass").replace("{step}", "pass")
    path, message = refusal(tmp_path, monkeypatch, text)
    assert message == f"{path}:1: imports numpy, but an FMU has the standard library only"
