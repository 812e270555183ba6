"""Whatever a slave calls what it has, it can be written out as C: everything there has a prefix."""

import importlib
import itertools
import keyword
import re
from pathlib import Path

import pytest

from fmu_kit.bundle import Target
from fmu_kit.compiler.emit.c_names import KEYWORDS
from fmu_kit.compiler.emit.exchange import described
from fmu_kit.compiler.emit.standards import STANDARDS
from fmu_kit.compiler.pack import lanes
from fmu_kit.compiler.pack.building import c_sources, modules_of
from fmu_kit.compiler.pack.c_compiler import compiled_here
from fmu_kit.compiler.pack.embedded_files import write
from fmu_kit.compiler.passes.precomputing import precompute
from fmu_kit.compiler.runtime import FOLDER
from fmu_kit.compiler.trace.tracing import trace
from fmu_kit.declared_names import PYTHONFMU_NAMES
from fmu_kit.packaging import slave_class
from fmu_kit.slave import Slave
from tests.extent import in_test_all
from tests.fmu_kit.compiler.compiled import compiler
from tests.fmu_kit.compiler.embedded import _succeeds, assert_its_header_is_kept
from tests.fmu_kit.compiler.probes import Kept
from tests.fmu_kit.compiler.twins import GUID, InC, InPython, answers, compiled

FILES = ("exchange.h", "instance.h", "fmi2.c", "fmi3.c", "lanes.c", "embedded.c", "embedded.h")
HERE = {
    name
    for file in FILES
    for name in re.findall(r"^\w.*?\b([A-Za-z]\w*)(?=\(|;)", (FOLDER / file).read_text("utf-8"), re.MULTILINE)
}
ELSEWHERE = {
    "errno",
    "stdin",
    "signal",
    "time",
    "div",
    "abs",
    "exit",
    "random",
    "system",
    "free",
    "input",
    "y0",
    "real",
}
PERVERSE = {
    "größe",
    "step_with_tangents",
    "x1",
    "p_x1",
    "KEPT_STALE",
    "AT_error",
    "values_of",
    "error",
    "model",
    "warning",
}
OF_A_SLAVE = {name.lstrip("_") for name in (*dir(Kept(instance_name="kept")), *Slave.__annotations__, *PYTHONFMU_NAMES)}
NAMES = sorted(name for name in HERE | ELSEWHERE | PERVERSE | KEYWORDS if not keyword.iskeyword(name))
NAMES = [name for name in NAMES if name not in OF_A_SLAVE and not hasattr(Slave, name)]
SLAVE = """\
from fmu_kit.interface import Input, Output, Parameter
from fmu_kit.slave import Slave


class {model}(Slave):
    \"\"\"Names.\"\"\"

{declared}
    failed = Input("A number.", None, 1.0)
    real = Parameter("A number.", None, 2.0)
    sum_of_all = Output("A number.", None)

    def initialise(self, t):
{initialised}

{methods}
    def step(self, t, h):
        total = self.failed + self.real
{called}
        self.sum_of_all = total
"""


def named(model: str, names: list[str]) -> str:
    """A slave whose variables, methods, parameters and attributes have these names."""
    kinds = itertools.cycle(("Input", "Parameter", "Output"))
    lines = {
        "declared": [f'    {name} = {next(kinds)}("A number.", None, {k}.5)' for k, name in enumerate(names)],
        "initialised": [f"        self._{name}_ = {k}.0" for k, name in enumerate(names)],
        "methods": [
            f"    def _{name}(self, {name}):\n        self._{name}_ += {name}\n        return self._{name}_\n"
            for name in names
        ],
        "called": [f"        total += 2.0 * total + self._{name}(self.{name})" for name in names],
    }
    return SLAVE.format(model=model, **{key: "\n".join(value) for key, value in lines.items()})


@pytest.fixture
def target(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Target:
    """A slave in which everything is called as something in C."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "names_of_c.py").write_text(named("Instance", NAMES), "utf-8")
    importlib.invalidate_caches()
    return Target("names_of_c", "Instance", tmp_path)


def test_a_slave_may_call_its_own_what_it_likes(
    target: Target, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler("cc")
    monkeypatch.setattr(lanes, "FOR_THIS_PROCESSOR", ("-O0",))  # names clash without optimisation too
    assert len(NAMES) > 140
    cls = slave_class(target)
    program = trace(cls, modules_of(target))
    sources = c_sources(program, GUID, STANDARDS[3])
    assert compiled_here(sources, STANDARDS[3].main, options=("-O0",))
    assert lanes.compiled_lanes(sources, 2)
    expected = answers(InPython(cls(instance_name="names")), {}, [{}] * 3)
    path = compiled(precompute(program), tmp_path / "names.so", "libm")
    assert answers(InC.made(cls, path), {}, [{}] * 3) == expected


@in_test_all
def test_embedded_c_has_names_that_are_keywords_of_c(target: Target, tmp_path: Path) -> None:
    for single in (False, True):
        source = write(target, tmp_path, single=single)
        assert_its_header_is_kept(source, "-O0")
    seen = tmp_path / "seen.cpp"
    seen.write_text(f'#include <cmath>\n#include <cstdio>\n#include "{source.stem}.h"\n')
    _succeeds([compiler("g++"), "-fsyntax-only", str(seen)])


OBSERVING = """from fmu_kit.interface import Input, Output, State
from fmu_kit.slave import Slave


class Observing(Slave):
    u = Input("rate", "m/s")
    x = State("position", "m")
    power = Output("what is observed", "W")
    continuous_states = ("x",)

    @classmethod
    def initial_dependencies(cls, output):
        return {"x": frozenset({"initial.x"})}.get(output)

    def step(self, t, h):
        self.x = self.x + h * self.u
        self.power = self.x * self.u

    def derivatives(self, t, since):
        self.power = self.x * self.u
        return (self.u,)
"""


def test_an_output_whose_dependencies_are_not_said_may_depend_on_all_states_and_inputs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "observing.py").write_text(OBSERVING, "utf-8")
    importlib.invalidate_caches()
    target = Target("observing", "Observing", tmp_path)
    program = trace(slave_class(target), modules_of(target))
    for version, state in ((2, "2"), (3, "1")):
        structure = described(program, STANDARDS[version]).find("ModelStructure")
        assert structure is not None
        key = "index" if version == 2 else "valueReference"
        said = [(each.get(key), each.get("dependencies")) for each in structure.iter() if each.get(key)]
        power = str(int(state) + 1)
        assert said[:2] == [(state, state), (power, None)]
        assert (power, None) in said[2:]
        assert "" not in dict(said).values()
