"""Float code of controllers in C: linear theory takes it in double precision, if that is the same law."""

import re
from pathlib import Path

import numpy as np
import pytest

from orchestration.components.building import wrap
from orchestration.systems.system.files import files_of
from orchestration.theory.exact.loops import Loops
from orchestration.theory.stability.operating_point import deterministic
from quadcosim import UsageError, changed, linearise, load_system
from tests.places import ROOT

EXAMPLE = ROOT / "examples" / "double_integrator"
H = 0.05
PI_TOML = """\
name = "Pi"
period = 0.05
sources = ["pi.c"{source}]
declare = "extern float x, v, u, k_i; void pi_step(void);"
step = "pi_step();"
[inputs]
x = {{ c = "x", unit = "m" }}
v = {{ c = "v", unit = "m/s" }}
[outputs]
u = {{ c = "u", unit = "m/s2" }}
[parameters]
k_i = "k_i"
"""
PI_C = """\
#include <math.h>
#include <string.h>
float x = 10.0f, v, u, k_i = 1e-4f;
static float integral, of_square(float y);
void pi_step(void)
{
    const float e = x - 10.0f;
    integral += k_i * 0.05f * e;
    u = fmaxf(-4e-6f * e - v * of_square(4.0f + e) - integral - e, -50.0f);
}
static float of_square(float y) { return 2.0f / sqrtf(y); }
"""
PUNNED = """\
static float of_square(float y)
{
    int i;
    memcpy(&i, &y, 4);
    i = 0x5f3759df - (i >> 1);
    const float half = 0.5f * y;
    memcpy(&y, &i, 4);
    return 2.0f * y * (1.5f - half * y * y);
}
"""


def written(folder: Path, code: str = PI_C, source: str = "") -> Path:
    """A system file of a double integrator that is held at 10 m by this code."""
    text = (EXAMPLE / "system.toml").read_text().replace("StateFeedback.fmu", "pi.toml")
    text = text.replace('initial.x" = 0.0', 'initial.x" = 10.0')
    files = {"pi.c": code, "pi.toml": PI_TOML.format(source=source), "system.toml": text}
    for name, content in {**files, "plant.py": (EXAMPLE / "plant.py").read_text()}.items():
        (folder / name).write_text(content)
    return folder / "system.toml"


def poles(k_i: float, k_p: float = 4e-6) -> np.ndarray:
    """Of the law and the exact map of the plant, from the state x, v and the integral."""
    x, v, integral = np.eye(3)
    after = integral + k_i * float(np.float32(H)) * x
    u = -(1.0 + float(np.float32(k_p))) * x - v - after
    return np.linalg.eigvals(np.array([x + H * v + 0.5 * H * H * u, v + H * u, after]))


def slowest(file: Path, k_i: float) -> float:
    """The slowest pole of a system, if all are those of the law."""
    found = linearise(changed(load_system(file), {"components.controller.parameters.k_i": k_i}))
    assert found.in_double == ("controller",)
    assert found.verdict.endswith(", float code of controller in double precision")
    (slow, *_) = (pole.z for pole in found.poles)
    assert min(abs(poles(k_i) - slow)) < 1e-10
    assert found.radius == pytest.approx(np.abs(poles(k_i)).max(), abs=1e-10)
    return slow.real


def test_slow_integrals_have_the_poles_of_the_law(tmp_path: Path) -> None:
    file = written(tmp_path)
    assert slowest(file, 1e-5) < 1.0 < slowest(file, -1e-5)


def test_a_system_in_double_is_solved_by_the_models_of_its_own_files(tmp_path: Path) -> None:
    """As its sequences of jobs are, of which one may break the loop."""
    system = load_system(written(tmp_path))
    loops = Loops(files_of(system).models)
    assert loops.radius(deterministic(system), agree=1e-9) == loops.radius(system, agree=1e-9)


def test_the_code_is_compiled_once_until_it_changes_and_never_beside_the_users(tmp_path: Path) -> None:
    file = written(tmp_path).parent / "pi.toml"
    twin = wrap.in_double(str(file))
    assert twin is not None
    assert twin.is_relative_to(wrap.in_double_folder())
    assert [path.name for path in tmp_path.rglob("*.fmu")] == ["Pi.fmu"]
    made = twin.stat()
    assert wrap.in_double(str(tmp_path / "Pi.fmu")) == twin  # as its FMU is named, too
    assert (twin.stat().st_ino, twin.stat().st_mtime_ns) == (made.st_ino, made.st_mtime_ns)
    written(tmp_path, PI_C.replace("4.0f + e", "1.0f + e"))
    assert wrap.in_double(str(tmp_path / "Pi.fmu")) is None  # it is of other sources
    assert wrap.in_double(str(file)) != twin


def test_code_that_relies_on_the_bits_of_a_float_is_refused_by_what_it_does(tmp_path: Path) -> None:
    code = re.sub(r"static float of_square\(float y\) \{.*\n", PUNNED, PI_C)
    with pytest.raises(UsageError, match=r"controller: its float code in double precision, .* is another law: .* by"):
        linearise(load_system(written(tmp_path, code)))


def test_a_converter_within_the_code_is_refused_with_its_place_in_the_system(tmp_path: Path) -> None:
    code = PI_C.replace("x - 10.0f", "0.005f * rintf((x - 10.0f) / 0.005f)")
    with pytest.raises(UsageError, match=r", or that quantises .*: expected .* as quantisation of its connection"):
        linearise(load_system(written(tmp_path, code)))


@pytest.mark.parametrize(
    ("added", "source", "said"),
    [
        ("", ', "nothing.S"', r"pi\.toml: sources: nothing\.S: expected its C, of which floats become doubles"),
        ('_Static_assert(sizeof u == 4, "of 4 bytes");', "", r"pi\.c:\d+:\d+: error: of 4 bytes"),
    ],
)
def test_what_cannot_be_compiled_so_is_refused_in_words(tmp_path: Path, added: str, source: str, said: str) -> None:
    written(tmp_path, PI_C + added + "\n", source)
    (tmp_path / "nothing.S").write_text("")
    with pytest.raises(UsageError, match=f"the linear theory takes floats in double precision, and .*{said}"):
        wrap.in_double(str(tmp_path / "pi.toml"))


def test_code_without_floats_is_taken_as_it_is(tmp_path: Path) -> None:
    written(
        tmp_path, re.sub(r"(\d)f\b", r"\1", PI_C).replace("float", "double").replace("tf(", "t(").replace("xf(", "x(")
    )
    file = tmp_path / "pi.toml"
    file.write_text(file.read_text().replace("float", "double"))
    assert wrap.in_double(str(file)) is None
