"""Objects of a user's own C, which stays as it is: compiled, joined into one, and what they can write made one section.

Undefined symbols decide what the code is. What only computes has a state that can be saved. What takes memory from the
heap has one that cannot. What reads the time, waits, draws random numbers or writes files is refused by name, since its
results would not depend on its inputs alone.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fmu_kit.bundle import PackagingError
from fmu_kit.compiler.emit.user_code import CXX, UserCode
from fmu_kit.compiler.pack.c_compiler import compiler, output_of
from fmu_kit.compiler.pack.in_double import MATHEMATICS, in_double

SECTION = "quadcosim_state"
_OPTIONS = (
    *("-O2", "-g1", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", "-fno-strict-aliasing", "-fno-common"),
    *("-Wall", "-U_FORTIFY_SOURCE", "-fdiagnostics-color=never", "-gno-record-gcc-switches"),
)
# Traps need no library of the compiler's; that for addresses would have to be the first in the process.
_CHECKS = (
    "-fsanitize=bounds-strict,shift,integer-divide-by-zero,signed-integer-overflow,float-cast-overflow",
    "-fsanitize-undefined-trap-on-error",
)
_LIBRARY = (".a", ".o")
"""Endings of sources that are compiled already, such as static libraries of Rust"""
_COMPILED = (*_LIBRARY, ".s", ".S")
"""Those, and of assembler"""


class RefusedCodeError(PackagingError):
    """Code that cannot be wrapped as it is; the text says what to change."""


@dataclass(frozen=True, kw_only=True)
class Objects:
    """The objects of a user's code, joined into one."""

    path: Path
    state_bytes: int
    """size of the section with all that the code can write"""
    is_pure: bool
    """whether it uses nothing outside of itself, so that its state is that section"""
    read: tuple[str, ...]
    """paths of the files that were compiled, those of the system aside"""
    warnings: tuple[str, ...]
    """warnings of the compiler, as PLACE: TEXT, those of what is unused last"""


_OTHERS = (
    "memcpy memmove memset memcmp memchr strlen strcmp strncmp strcpy strncpy strcat strncat strchr strstr abs labs "
    "llabs div ldiv abort qsort bsearch __assert_fail __errno_location __stack_chk_fail _GLOBAL_OFFSET_TABLE_ "
    "__dso_handle _Unwind_Resume __memcpy_chk __memset_chk __cxa_pure_virtual __cxa_atexit __cxa_guard_acquire "
    "__cxa_guard_release __gxx_personality_v0 __isnan __isinf __finite __fpclassify __signbit __isnanf __isinff "
    "__finitef __fpclassifyf"
)
_PURE = frozenset([f"{name}{kind}" for name in MATHEMATICS.split() for kind in ("", "f", "l")] + _OTHERS.split())
_PURE_KINDS = re.compile(r"_ZTVN10__cxxabiv1|__(add|sub|mul|div|mod|neg|fix|float|ext|trunc|u?div|u?mod)\w*[sdtx][fi]")
"""Type information of C++, arithmetic of the compiler's own library"""
_HEAP = re.compile(r"malloc$|calloc$|realloc$|free$|aligned_alloc$|posix_memalign$|_Zn[wa]m|_Zd[la]Pv")
_IMPURE = {
    "reads the time": (
        *("time", "clock", "clock_gettime", "gettimeofday", "times", "timespec_get", "localtime", "gmtime"),
        "mktime",
    ),
    "waits": ("sleep", "usleep", "nanosleep", "clock_nanosleep", "select", "poll"),
    "draws random numbers": ("rand", "srand", "random", "srandom", "drand48", "getrandom", "arc4random", "rand_r"),
    "writes or reads a file": (
        *("printf", "fprintf", "vprintf", "vfprintf", "puts", "putchar", "fputs", "fputc", "putc", "fwrite", "fread"),
        *("fopen", "fclose", "fflush", "open", "close", "read", "write", "scanf", "fscanf", "getchar", "perror"),
        *("stdout", "stderr", "stdin", "__printf_chk", "__fprintf_chk"),
    ),
    "starts or stops a thread": ("pthread_create", "pthread_join", "pthread_mutex_lock", "pthread_mutex_unlock"),
    "ends the process": ("exit", "_exit", "raise", "kill", "signal"),
    "reads the environment": ("getenv", "setenv", "system"),
}
_ADVICE = {"reads the time": "a stub that counts samples in a source, as `{} = samples * PERIOD`"}


def build_objects(code: UserCode, user: Path, folder: Path) -> Objects:
    """Compile the sources of a user and `user`, the file that calls them, in `folder`.

    Raises `RefusedCodeError` naming the user's file and line, and `PackagingError` without a compiler.
    """
    compiled, libraries, read, warnings = [], [], [], list[str]()
    for number, source in enumerate([*code.sources, str(user)]):
        path = Path(code.folder, source)
        if not path.is_file():
            raise RefusedCodeError(f"{code.file}: sources: {source}: no such file in {code.folder}")
        if code.in_double and path.suffix in _COMPILED:
            raise RefusedCodeError(f"{code.file}: sources: {source}: expected its C, of which floats become doubles")
        if path.suffix in _LIBRARY:
            libraries.append(path)
            read.append(str(path))
            continue
        target = folder / f"{number}.o"
        command, rule = [*_compiler_of(path), *_options(code, folder)], ["-MMD", "-MF", target.with_suffix(".d")]
        if code.in_double:
            preprocessed = folder / f"{number}{'.ii' if path.suffix in CXX else '.i'}"
            _run(code, [*command, *rule, "-DQUADCOSIM_IN_DOUBLE", "-E", path, "-o", preprocessed], folder)
            text = preprocessed.read_text(encoding="utf-8", errors="surrogateescape")
            preprocessed.write_text(in_double(text), encoding="utf-8", errors="surrogateescape")
            command, rule, path = [*command, "-w"], [], preprocessed
        said = _run(code, [*command, *rule, "-c", path, "-o", target], folder)
        warnings += _warnings(code, said)
        read += [name for name in _prerequisites(target.with_suffix(".d")) if name != str(user)]
        compiled.append(target)
    joined = folder / "joined.o"
    _run(code, ["ld", "-r", "--force-group-allocation", "-o", joined, *compiled, *libraries], folder)
    is_pure = _expect_usable(code, joined, folder)
    path, size = _with_one_section(joined, folder, has_lines=not libraries)
    relative = tuple(dict.fromkeys(str(Path(code.folder, name).resolve()) for name in read))
    told = sorted(dict.fromkeys(warnings), key=lambda text: "[-Wunused" in text)
    return Objects(path=path, state_bytes=size, is_pure=is_pure, read=relative, warnings=tuple(told))


def libraries(code: UserCode) -> list[str]:
    """What the code is linked with: mathematics, and for C++ what takes memory from the heap."""
    return [*(["-Wl,-Bstatic", "-lstdc++", "-Wl,-Bdynamic"] if code.is_cxx else []), "-lm"]


def _compiler_of(source: Path) -> list[str]:
    if source.suffix not in CXX:
        # A function without a declaration would be taken to return an int: wrong numbers, without a word.
        return [compiler(), "-std=gnu11", "-Werror=implicit-function-declaration"]
    cxx = shutil.which("c++")
    if cxx is None:
        raise PackagingError("no C++ compiler that is called c++: install one (Debian, Ubuntu: apt install g++)")
    return [cxx, "-std=gnu++17", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics"]


def _options(code: UserCode, folder: Path) -> list[str]:
    include = [f"-I{Path(code.folder, path).resolve()}" for path in code.include]
    # The same bytes wherever the code is and wherever it is compiled.
    named = [f"-ffile-prefix-map={path}=." for path in (code.folder, Path(code.folder).resolve(), folder.resolve())]
    return [
        *_OPTIONS,
        *(_CHECKS if code.sanitize else ()),
        *named,
        *include,
        *(f"-D{define}" for define in code.defines),
    ]


def _prerequisites(rule: Path) -> list[str]:
    """The files that a rule of make, written by the compiler, names after its target."""
    _, _, listed = rule.read_text(encoding="utf-8", errors="surrogateescape").replace("\\\n", " ").partition(": ")
    return [name.replace("\\ ", " ") for name in re.split(r"(?<!\\)\s+", listed) if name]


def _run(code: UserCode, command: Sequence[object], folder: Path) -> str:
    try:
        return output_of([*map(str, command)], folder)
    except PackagingError as error:
        raise RefusedCodeError(_in_users_words(code, str(error).partition(": ")[2])) from error


def _in_users_words(code: UserCode, said: str) -> str:
    """What the compiler says, with places as in the user's file and folder."""
    said = said.replace("<command-line>:", f"{code.file}: defines:").replace(f"{Path(code.folder).resolve()}/", "")
    said = re.sub(rf"({re.escape(code.file)}:\d+):\d+:", r"\1:", said)
    return re.sub(r"static assertion failed: \"?(.*?)\"?$", r"\1", said)


def _warnings(code: UserCode, said: str) -> list[str]:
    """The compiler's warnings about lines of the user, as PLACE: TEXT."""
    found = re.findall(r"^(?!user_code:)(.+:\d+): warning: (.+)$", said, re.MULTILINE)
    return [_in_users_words(code, f"{place}: {text}") for place, text in found]


def _expect_usable(code: UserCode, joined: Path, folder: Path) -> bool:
    """Whether the code is pure; raises `RefusedCodeError` for what it must not use."""
    sections = output_of(["objdump", "-h", str(joined)], folder)
    if "THREAD_LOCAL" in sections:
        raise RefusedCodeError(f"{code.file}: sources: have thread-local variables: expected none, there is one thread")
    # A line has the symbol and, after a tab, the first line of the sources that uses it.
    undefined = re.findall(r"^\s+U (\S+)(?:\t(.*))?$", output_of(["nm", "-u", "-l", str(joined)], folder), re.MULTILINE)
    used = {name: line for name, line in undefined if name not in _PURE and not _PURE_KINDS.match(name)}
    for symbol, line in used.items():
        if not _HEAP.match(symbol):
            raise RefusedCodeError(f"{code.file}: {_refusal(symbol, Path(line).name or 'them')}")
    return not used


def _refusal(symbol: str, where: str) -> str:
    for what, names in _IMPURE.items():
        if symbol in names:
            advice = _ADVICE.get(what, "a stub of {} in a source").format(symbol)
            return f"{symbol}, used in {where}, {what}: expected {advice}"
    return (
        f"{symbol}, used in {where}, is in none of the sources, nor a function of C that only computes: expected the "
        "source that defines it, or a stub"
    )


def _with_one_section(joined: Path, folder: Path, *, has_lines: bool) -> tuple[Path, int]:
    """The objects with all sections that code can write as one, and its size [bytes].

    With their lines, by which a crash is found, unless there are libraries: theirs have paths of other machines.
    Constants that the loader relocates, and lists of functions that run before and after, are no state.
    """
    lines = output_of(["objdump", "-h", "-w", str(joined)], folder).splitlines()
    rows = [line.split(maxsplit=6) for line in lines if re.match(r"\s*\d+ ", line)]
    written = [
        row[1]
        for row in rows
        if "ALLOC" in row[6] and "READONLY" not in row[6] and int(row[2], 16) > 0
        and not row[1].startswith((".data.rel.ro", ".init_array", ".fini_array", ".ctors", ".dtors"))
    ]  # fmt: skip
    renamed = [f"--rename-section={name}={SECTION},alloc,load,data,contents" for name in written]
    output_of(["objcopy", *renamed, str(joined), "renamed.o"], folder)
    output_of(["ld", "-r", "-o", "code.o", "renamed.o"], folder)
    # Names of the code are its own: a stub of printf is not that of whoever is linked with it.
    stripped = [] if has_lines else ["--strip-debug"]
    output_of(["objcopy", *stripped, "--wildcard", "--keep-global-symbol=quadcosim_*", "code.o"], folder)
    return folder / "code.o", _size_of(folder / "code.o", folder)


def _size_of(path: Path, folder: Path) -> int:
    lines = output_of(["objdump", "-h", "-w", str(path)], folder).splitlines()
    sizes: Iterable[str] = (line.split()[2] for line in lines if line.split()[1:2] == [SECTION])
    return sum(int(size, 16) for size in sizes)
