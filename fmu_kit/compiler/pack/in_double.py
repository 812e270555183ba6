"""A user's C with its floats as doubles: its law nearly in real arithmetic, for what rounding would hide.

It is preprocessed first, so that headers of the system keep their floats, and declarations are those that the code has.
Constants keep the value that they have as floats.
"""

import re

MATHEMATICS = (
    "acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim floor fma "
    "fmax fmin fmod frexp hypot ilogb ldexp lgamma llrint llround log log10 log1p log2 logb lrint lround modf nan "
    "nearbyint nextafter pow remainder remquo rint round scalbn sin sincos sinh sqrt tan tanh tgamma trunc"
)
"""Functions of C that only compute, of which those of floats end in f"""
_OTHERS = "cabs carg ccos cexp cimag clog conj cpow creal csin csqrt ctan exp10 huge_val inf isnan isinf finite"
_FUNCTION = rf"(?:__builtin_)?(?:{'|'.join(f'{MATHEMATICS} {_OTHERS}'.split())})f"
_IS_FLOAT = re.compile(rf"\b(?:float|_Float32|{_FUNCTION}\b)")
_TOKEN = re.compile(
    r""""(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'"""
    r"|(?P<number>\.?\d(?:[eEpP][+-]|'\w|[\w.])*)"
    rf"|(?P<type>\b(?:float|_Float32)\b)|\b(?P<function>{_FUNCTION})\b|\w+"
)
_LITERAL = re.compile(r"(?:[\d.][\d.']*(?:[eE][+-]?\d+)?|0[xX][\da-fA-F.]+[pP][+-]?\d+)[fF]")
_MARKER = re.compile(r'# \d+ "(?P<file>.*)"(?P<flags>[ \d]*)$')


def has_floats(source: str) -> bool:
    """Whether a source, or a header, has floats."""
    return _IS_FLOAT.search(source) is not None


def in_double(preprocessed: str) -> str:
    """What the preprocessor made of a source, with doubles for floats but in headers of the system."""
    lines, own, is_own = [], "", True
    for line in preprocessed.splitlines():
        if marker := _MARKER.match(line):
            of_system = "3" in marker["flags"].split()
            own = own if of_system else marker["file"]
            is_own = marker["file"] == own  # also what a macro of the system became in it
        lines.append(_TOKEN.sub(_of_token, line) if is_own and not line.startswith("#") else line)
    return "\n".join([*lines, ""])


def _of_token(token: re.Match[str]) -> str:
    if token["type"]:
        return "double"
    if token["function"]:
        return token[0][:-1]
    return f"((double){token[0]})" if token["number"] and _LITERAL.fullmatch(token[0]) else token[0]
