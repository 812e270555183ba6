"""What is done to preprocessed C, so that its floats are doubles."""

import pytest

from fmu_kit.compiler.pack.in_double import has_floats, in_double


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        (
            "float x = 0.1f, y[2] = {1.f, .5e-3F};",
            "double x = ((double)0.1f), y[2] = {((double)1.f), ((double).5e-3F)};",
        ),
        ("return __builtin_fabsf(sinf(a.floats));", "return __builtin_fabs(sin(a.floats));"),
        ("unsigned i = 0x1f + 0x1p3f; long double z;", "unsigned i = 0x1f + ((double)0x1p3f); long double z;"),
        ('const char *s = "a \\" 1.0f float"; char c = \'"\';', None),
        ("#pragma float 1.0f", None),
        ("int of_float = my_sinf + sinfx;", None),
    ],
)
def test_types_literals_and_functions_of_floats_become_those_of_doubles(code: str, expected: str | None) -> None:
    assert in_double(code) == f"{code if expected is None else expected}\n"


def test_headers_of_the_system_keep_their_floats_but_not_what_their_macros_make_in_the_code() -> None:
    text = (
        '# 1 "a.c"\nfloat a;\n# 1 "/usr/include/math.h" 1 3 4\nfloat b;\n# 2 "a.c" 2\nfloat c =\n# 3 "a.c" 3 4\n1e-7F\n'
    )
    assert in_double(text).splitlines()[1::2] == ["double a;", "float b;", "double c =", "((double)1e-7F)"]


@pytest.mark.parametrize(
    ("source", "has"), [("float32_t x;", True), ("x = sinf(y);", True), ("afloat = y.sin;", False)]
)
def test_a_source_with_floats_is_known(source: str, has: bool) -> None:
    assert has_floats(source) is has
