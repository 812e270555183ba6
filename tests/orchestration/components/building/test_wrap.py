"""Controllers that exist only as C: wrapped as FMUs, their sources as they are."""

import hashlib
import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fmu_kit.compiler.pack import wrapping
from fmu_kit.compiler.pack.user_objects import RefusedCodeError
from orchestration.components.building import builder, wrap
from orchestration.components.fmi.opening import open_here
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import UsageError
from tests.commands import Main
from tests.extent import sample
from tests.places import EXAMPLES

PD_H = """\
typedef struct { double x, v; } pd_in;
typedef struct { double u; } pd_out;
extern double pd_kp, pd_kd;
void pd_init(void);
void pd_step(const pd_in *, pd_out *);
"""
PD_C = """\
#include "pd.h"
double pd_kp = 1.0, pd_kd = 1.0;
void pd_init(void) {}
void pd_step(const pd_in *in, pd_out *out) { out->u = -pd_kp * in->x - pd_kd * in->v; }
"""
PD = """\
name = "Pd"
period = 0.05
sources = ["pd.c"]
headers = ["pd.h"]
author = "A"
declare = "static pd_in in; static pd_out out;"
init = "pd_init();"
step = "pd_step(&in, &out);"
[inputs]
x = { c = "in.x", unit = "m" }
v = { c = "in.v", unit = "m/s" }
[outputs]
u = { c = "out.u", unit = "m/s2" }
[parameters]
k_p = "pd_kp"
k_d = { c = "pd_kd", min = 0 }
"""
TICK_C = """\
static int of_file = 100;
static float *where;
float filter[3];
struct { unsigned low : 3; } bits;
double tick(double x) {
    static double of_function;
    static int calls;
    where = &filter[calls++ % 3];
    *where = 0.5f * *where + (float)x;
    of_function += x * ++of_file;
    bits.low++;
    return of_function + *where + bits.low;
}
"""
TICK = """\
name = "Tick"
period = 1.0
sources = ["tick.c"]
declare = '''
double tick(double); extern float filter[3];
static double x, y; static short whole;
'''
step = "y = tick(x) + whole;"
[inputs]
x = "x"
whole = "whole"
[outputs]
y = "y"
third = "filter[2]"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two controllers in C."""
    folder = tmp_path_factory.mktemp("wrapped")
    files = {"pd.c": PD_C, "pd.h": PD_H, "pd.toml": PD, "tick.c": TICK_C, "tick.toml": TICK}
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


@pytest.fixture(scope="module")
def pd(folder: Path) -> Path:
    """The FMU of a PD."""
    return wrap.build(folder / "pd.toml", wrap.fmu_of(folder / "pd.toml"))


@pytest.fixture(scope="module", params=sample([2, 3], 1))
def tick(folder: Path, request: pytest.FixtureRequest) -> Path:
    """The FMU of code with state in statics of its file and of its function, of FMI 2.0 and 3.0."""
    file = folder / "tick.toml"
    return wrap.build(file, wrap.fmu_of(file, request.param), version=request.param)


@pytest.fixture
def of(tmp_path: Path) -> Callable[..., Path]:
    """Writes a controller with changed lines, and files beside it."""

    def write(change: Callable[[str], str] = str, **files: str) -> Path:
        texts = {"pd.c": PD_C, "pd.h": PD_H, "pd.toml": change(PD)}
        for name, text in {**texts, **{name.replace("_", "."): text for name, text in files.items()}}.items():
            (tmp_path / name).write_text(text)
        return tmp_path / "pd.toml"

    return write


def refusal(file: Path) -> str:
    """Why it is refused: the code, by the packer in this process."""
    with pytest.raises((UsageError, RefusedCodeError)) as raised:
        wrapping.build(wrapping.from_json(json.dumps(wrap.description_of(file))), file.with_suffix(".fmu"))
    return str(raised.value).replace(f"{file.parent}/", "")


class Flight:
    """An instance that is stepped with random inputs."""

    def __init__(self, fmu: Path) -> None:
        self.instance = open_here(fmu, "it")
        self.given, self.found = np.zeros(2), np.zeros(2)
        self.begin()

    def begin(self) -> None:
        """Initialise."""
        self.instance.enter_initialization(0.0, 1e9)
        self.write = self.instance.writer(("x", "whole"), self.given)
        self.read = self.instance.reader(("y", "third"), self.found)
        self.instance.exit_initialization()
        self.time, self.seen = 0.0, hashlib.sha256()

    def go(self, seed: int, steps: int = 1, *, first: int = 0) -> str:
        """Go on; the hash of all outputs since the start or since it was restored."""
        for step in range(first, first + steps):
            self.given[:] = np.random.default_rng((seed, step)).normal(size=2) * 3.0
            self.write()
            self.instance.step(self.time, 1.0)
            self.time += 1.0
            self.read()
            self.seen.update(self.found.tobytes())
        return self.seen.hexdigest()


def test_two_instances_in_turns_each_go_as_alone(tick: Path) -> None:
    alone = [Flight(tick).go(seed, 300) for seed in (1, 2)]
    one, other = Flight(tick), Flight(tick)
    for step in range(300):
        one.go(1, first=step)
        other.go(2, first=step)
    assert [one.seen.hexdigest(), other.seen.hexdigest()] == alone
    assert alone[0] != alone[1]


def test_a_saved_state_goes_on_as_if_nothing_had_happened(tick: Path) -> None:
    flight, fresh = Flight(tick), Flight(tick)
    flight.go(1, 50)
    saved = flight.instance.save()
    flight.seen = hashlib.sha256()
    expected = flight.go(1, 40, first=50)
    for restored in (flight, fresh):
        restored.go(7, 33)
        restored.instance.restore(saved)
        restored.time, restored.seen = 50.0, hashlib.sha256()
        assert restored.go(1, 40, first=50) == expected


def test_a_reset_begins_with_what_the_code_begins_with(tick: Path) -> None:
    flight = Flight(tick)
    before = flight.go(1, 20)
    flight.instance.reset()
    flight.begin()
    assert flight.go(1, 20) == before


def test_integers_are_rounded_and_floats_kept(tick: Path) -> None:
    flight = Flight(tick)
    found = []
    for given in (0.4, 0.6, -0.6, -1.4):
        flight.given[:] = 0.0, given
        flight.write()
        flight.instance.step(flight.time, 1.0)
        flight.time += 1.0
        flight.read()
        found.append(flight.found[0])
    assert np.diff(found).tolist() == [2.0, -1.0, 1.0]  # the counter adds one each time


@pytest.mark.parametrize("given", [32768.0, -1e300], ids=["one too many", "beyond all integers"])
def test_an_input_that_its_integer_does_not_hold_is_refused(tick: Path, given: float) -> None:
    flight = Flight(tick)
    flight.given[:] = 0.0, given
    flight.write()
    with pytest.raises(Exception, match=r"whole = .*: expected a value that its integer type in C holds; what clips"):
        flight.instance.step(flight.time, 1.0)


def test_start_values_come_from_the_code_and_its_constants_are_units(pd: Path) -> None:
    model = read_model(pd)
    assert {name: each.start for name, each in model.variables.items() if each.causality == "parameter"} == {
        "k_p": "1.0",
        "k_d": "1.0",
    }
    assert (model.variables["u"].unit, model.variables["k_d"].minimum) == ("m/s2", 0.0)
    assert model.believed_period == 0.05
    assert (model.saves_state, model.once_per_process, model.is_own) == (True, False, False)


def test_validate_finds_nothing(pd: Path, tick: Path, main: Main) -> None:
    assert "no problems found" in main("validate", pd, tick).stdout


def test_a_parameter_out_of_its_bounds_is_refused_by_name(pd: Path) -> None:
    instance = open_here(pd, "it")
    instance.set("k_d", -1.0)
    instance.enter_initialization(0.0, 1.0)
    with pytest.raises(Exception, match=r"k_d = -1\.0: expected a finite value >= 0"):
        instance.exit_initialization()


def test_it_is_made_again_when_a_header_changes_only(of: Callable[..., Path], pd: Path) -> None:
    file = of()
    fmu = Path(shutil.copy(pd, file.parent))
    before = fmu.read_bytes()
    assert wrap.locate(file).read_bytes() == before
    assert wrap.build(file, fmu.with_name("again.fmu")).read_bytes() == before  # made in another folder, to the bit
    assert not wrap.is_out_of_date(fmu, file)
    of(pd_h=PD_H + "/* changed */\n")
    assert wrap.is_out_of_date(fmu, file)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("in.x", "in.q", "pd.toml:10: error: 'pd_in' has no member named 'q'"),
        ("in.x", "in.x * 2", "pd.toml:10: error: lvalue required as left operand of assignment"),
        ("pd_init();", "pd_init()", "pd.toml:7: error: expected ';' before '}' token"),
        ('"pd_step(&in, &out);"', "'''\npd_step(&in, &out);\nno;\n'''", "pd.toml:10: error: 'no' undeclared"),
        ('author = "A"', 'defines = ["double=5"]', "pd.toml: defines: error: expected"),
        (
            '"in.x"',
            '"in"',
            "pd.toml:10: error: inputs.x = in is an array, a pointer or a struct: expected one number, as",
        ),
        ('["pd.h"]', '["no.h"]', "pd.toml:4: fatal error: no.h: No such file or directory"),
    ],
)
def test_what_the_compiler_refuses_has_the_line_of_the_users_file(
    of: Callable[..., Path], old: str, new: str, told: str
) -> None:
    assert refusal(of(lambda text: text.replace(old, new))).startswith(told)


@pytest.mark.parametrize(
    ("value", "told"), [("g", "'g' undeclared"), ("g(1.0f)", "implicit declaration of function 'g'")]
)
def test_what_the_compiler_refuses_in_a_source_has_its_line(of: Callable[..., Path], value: str, told: str) -> None:
    refused = refusal(of(pd_c=f"double f(void) {{\n  return {value};\n}}\n"))
    assert refused.startswith(f"pd.c:2:10: error: {told}")


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("return clock() / 1e6;", "clock, used in it.c:5, reads the time: expected a stub"),
        ("return rand();", "rand, used in it.c:5, draws random numbers: expected a stub of rand"),
        ('printf("%d", 1); return 0;', "writes or reads a file: expected a stub of printf in a source"),
        ("extern int elsewhere(int); return elsewhere(1);", "elsewhere, used in it.c:5, is in none of the sources"),
    ],
)
def test_what_is_not_pure_is_refused_by_name_and_line(of: Callable[..., Path], line: str, told: str) -> None:
    code = f"#include <stdio.h>\n#include <stdlib.h>\n#include <time.h>\ndouble f(void) {{\n{line}\n}}\n"
    assert told in refusal(of(lambda text: text.replace('"pd.c"', '"pd.c", "it.c"'), it_c=code))


def test_code_that_fails_at_its_start_is_told_by_its_signal(of: Callable[..., Path]) -> None:
    file = of(lambda text: text.replace("pd_init();", "*(volatile int *)0 = 1;"))
    assert refusal(file) == "pd.toml:7: init: ended by signal 11: expected it to return"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("period = 0.05", "period = -1", "period = -1: expected a positive number of seconds"),
        ("period = 0.05", "", "period: expected the sampling period that the code believes"),
        ('unit = "m"', 'unit = "parsec"', "inputs.x: unit parsec: expected powers of"),
        ('unit = "m"', 'unit = "deg"', "as in N.m, kg.m2 or W/(m2.K); degrees are rad here, and converted in step"),
        ("period = 0.05", "period", "pd.toml: expected TOML"),
        ("sources", "source", "source: no such key; expected one of"),
        ('"pd.c"', '"no.c"', "sources: no.c: no such file in"),
        ('v = { c = "in.v"', '"v w" = { c = "in.v"', "inputs.v w: expected a name"),
        ('u = { c = "out.u"', 'x = { c = "out.u"', "outputs.x: expected another name than one of the inputs"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_in_words(of: Callable[..., Path], old: str, new: str, told: str) -> None:
    assert told in refusal(of(lambda text: text.replace(old, new)))


def test_the_command_ends_with_2_for_a_refused_source_and_makes_fmus(of: Callable[..., Path], main: Main) -> None:
    file = of(lambda text: text.replace("in.x", "in.q"))
    assert f"{file.parent}/pd.toml:10: error: 'pd_in' has no member named 'q'" in main("wrap", file, code=2).stderr
    code = main("wrap", file.with_suffix(".c"), code=2).stderr
    assert f"{file.with_suffix('.c')}: expected the .toml file that describes the code, as from quadcosim new" in code
    of(pd_c=PD_C + "static int " + ", ".join(f"i{k}" for k in range(12)) + ";\nint f(void) { int i; return i; }\n")
    done = main("wrap", file, "--fmi", "3", "--out", file.parent / "x")
    assert done.stdout.strip() == str(file.parent / "x" / "Pd.fmu")
    assert read_model(Path(done.stdout.strip())).version == 3
    first, *_, last = warned = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert first == f"warning: {file.parent}/pd.c:6:29: 'i' is used uninitialized [-Wuninitialized]"
    assert (len(warned), last) == (wrap.MOST_WARNINGS + 1, "warning: and 3 more of the compiler")


LAW = """\
name = "Law"
period = 0.05
sources = ["{source}"]
declare = '''
{declare}
static double x, u;
'''
step = "u = law(x, v);"
[inputs]
x = "x"
v = "v"
[outputs]
u = "u"
"""
HEAP = """\
#include <stdlib.h>
double law(double x, double v) { static double *p; if (!p) p = calloc(1, 8); return *p - x - v; }
"""
CXX = """\
struct Base { virtual double of(double x, double v) = 0; };
struct Law : Base {
    double sum;
    Law() : sum(0.5) {}
    double of(double x, double v) { static int calls; calls++; sum += x; return -x - v + 0 * calls; }
};
static Law it;
Base *now = &it;
double law(double x, double v) { return now->of(x, v); }
"""
RUST = """\
#![no_std]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! { loop {} }
static mut CALLS: u32 = 0;
#[no_mangle]
pub extern "C" fn law(x: f64, v: f64) -> f64 { unsafe { CALLS += 1; -x - v + (CALLS as f64) * 0.0 } }
"""
TASKS = """\
name = "Tasks"
sources = ["it.c"]
declare = "static int fast, slow;"
[[tasks]]
name = "fast"
period = 0.004
step = "fast++;"
[[tasks]]
name = "slow"
period = 0.01
step = "slow++;"
[outputs]
of_fast = "fast"
of_slow = "slow"
"""


def law_of(folder: Path, source: str, text: str, declare: str = "double law(double, double); static double v;") -> Path:
    """The FMU of u = -x - v, in another language."""
    (folder / source).write_text(text)
    if source.endswith(".rs"):
        rustc = ["rustc", "--crate-type", "staticlib", "-C", "panic=abort", "-O", source]
        subprocess.run(rustc, cwd=folder, check=True, capture_output=True)
        source = f"lib{source.removesuffix('.rs')}.a"
    file = folder / "law.toml"
    file.write_text(LAW.format(source=source, declare=declare))
    return wrap.build(file, wrap.fmu_of(file))


def test_code_that_takes_memory_from_the_heap_saves_no_state(tmp_path: Path) -> None:
    fmu = law_of(tmp_path, "law.c", HEAP)
    assert (read_model(fmu).once_per_process, read_model(fmu).saves_state) == (True, False)
    assert _output(fmu, {"x": 2.0, "v": 1.0}) == -3.0


def test_cxx_goes_the_same_way(tmp_path: Path) -> None:
    declare = "double law(double, double); static struct { unsigned low : 3; } bits;\n#define v bits.low"
    fmu = law_of(tmp_path, "law.cpp", CXX, declare)
    assert read_model(fmu).saves_state
    assert _output(fmu, {"x": 2.0, "v": 1.4}) == -3.0
    with pytest.raises(Exception, match=r"v = 8\.0: expected a value that its integer type in C holds"):
        _output(fmu, {"x": 2.0, "v": 8.0})


@pytest.mark.skipif(shutil.which("rustc") is None, reason="needs rustc")
def test_a_static_library_of_rust_goes_the_same_way(tmp_path: Path) -> None:
    fmu = law_of(tmp_path, "law.rs", RUST)
    assert read_model(fmu).saves_state
    assert _output(fmu, {"x": 2.0, "v": 1.0}) == -3.0


def test_tasks_run_at_their_own_multiples_of_their_common_period(tmp_path: Path) -> None:
    (tmp_path / "it.c").write_text("int nothing;\n")
    (tmp_path / "tasks.toml").write_text(TASKS)
    fmu = wrap.build(tmp_path / "tasks.toml", wrap.fmu_of(tmp_path / "tasks.toml"))
    assert read_model(fmu).believed_period == 0.002
    instance = open_here(fmu, "it")
    instance.enter_initialization(0.0, 1e9)
    found = np.zeros(2)
    read = instance.reader(("of_fast", "of_slow"), found)
    instance.exit_initialization()
    seen = []
    for step in range(11):
        instance.step(step * 0.002, 0.002)
        read()
        seen.append(tuple(found.tolist()))
    assert seen[:6] == [(1, 1), (1, 1), (2, 1), (2, 1), (3, 1), (3, 2)]
    assert seen[10] == (6, 3)


SECOND = [
    (
        'name = "fast"\nperiod = 0.01\nstep = "slow++;"',
        "9: tasks: name = fast: expected another name than that of a task",
    ),
    ('name = "slow"\nperiod = 0\nstep = "slow++;"', "10: tasks.slow.period = 0: expected a positive number of seconds"),
    ('name = "slow"\nperiod = 0.01\nstep = "later();"', "11: error: implicit declaration of function 'later'"),
    ('name = "slow"\nperiod = 0.01\nstep = "slow+;"', "11: error: expected expression before ';' token"),
    ('name = "slow"\nperiod = 0.01', "9: tasks: step: expected a value"),
    ('name = "s low"\nperiod = 0.01\nstep = ""', "9: tasks: name = 's low': expected letters, digits and _"),
    (
        'name = "slow"\nperiod = 0.01\nstep = ""\n[parameters]\nslow = "slow"',
        "parameters.slow: expected another name than one of the tasks, which are clocks in FMI 3.0",
    ),
]


@pytest.mark.parametrize(("task", "expected"), SECOND, ids=range(len(SECOND)))
def test_what_is_wrong_with_a_task_has_its_line(task: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "it.c").write_text("int nothing;\n")
    file = tmp_path / "tasks.toml"
    first = TASKS.partition('[[tasks]]\nname = "slow"')[0]
    file.write_text(f'{first}[[tasks]]\n{task}\n[outputs]\nof_fast = "fast"\n')
    with pytest.raises(UsageError, match=re.escape(expected)) as raised:
        wrap.build(file, wrap.fmu_of(file))
    assert str(file) in str(raised.value)


@pytest.mark.parametrize("place", ["", "tasks.toml"])
def test_what_makes_c_of_python_says_that_code_in_c_is_c_already(place: str, tmp_path: Path) -> None:
    (tmp_path / "tasks.toml").write_text(TASKS)
    with pytest.raises(UsageError, match=r"this is C already, .* by quadcosim wrap .*tasks\.toml$"):
        builder.slaves_named(str(tmp_path / place))


def test_beside_slaves_in_python_what_is_c_already_is_named(main: Main, tmp_path: Path) -> None:
    (tmp_path / "tasks.toml").write_text(TASKS)
    shutil.copy(EXAMPLES / "dc_motor" / "motor.py", tmp_path)
    with pytest.raises(UsageError, match=r"this is C already, .* by quadcosim wrap .*tasks\.toml$"):
        builder.slaves_named(str(tmp_path / "tasks.toml"))
    with pytest.raises(UsageError, match=rf"Moto: expected {tmp_path}/Motor, or {tmp_path} for all slaves of its"):
        builder.slaves_named(str(tmp_path / "Moto"))
    done = main("build", tmp_path)
    assert done.stdout.split() == [str(tmp_path / "Motor.fmu")]
    assert f"{tmp_path}/tasks.toml: describes code in C, of which there is no FMU, or an older one: quad" in done.stderr
    (tmp_path / "it.c").write_text("")
    wrap.locate(tmp_path / "tasks.toml")
    assert "tasks.toml" not in main("build", tmp_path).stderr
    (tmp_path / "it.c").write_text("int changed;")
    assert "tasks.toml: describes code" in main("build", tmp_path).stderr


def _output(fmu: Path, inputs: dict[str, float]) -> float:
    """The output u after a step."""
    instance = open_here(fmu, "it")
    instance.enter_initialization(0.0, 1e9)
    given, found = np.array([*inputs.values()]), np.zeros(1)
    write, read = instance.writer(tuple(inputs), given), instance.reader(("u",), found)
    instance.exit_initialization()
    write()
    instance.step(0.0, 0.05)
    read()
    return float(found[0])
