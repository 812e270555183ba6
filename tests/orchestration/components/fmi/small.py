"""FMUs of one C source with one habit each, compiled where the tests run, their descriptions written to fit."""

import shutil
import uuid
import zipfile
from pathlib import Path

import fmpy
import platformdirs
import pytest

from fmu_kit.archive import SOURCE_HASH_FILE
from orchestration.components.fmi import opening
from tests.native import library

COMPILER = shutil.which("gcc") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

_SOURCE = Path(__file__).with_name("small.c")
_KEPT = b"0123456789abcdef" * 2

_FMI2 = Path(__file__).with_name("small2.xml").read_text(encoding="utf-8")

_FMI3 = Path(__file__).with_name("small3.xml").read_text(encoding="utf-8")

_MODE = """<ScalarVariable name="mode" valueReference="6" causality="parameter" variability="fixed">
      <Enumeration declaredType="Mode" start="1"/></ScalarVariable>"""
_MODE_AS_INPUT = """<ScalarVariable name="mode" valueReference="6" causality="input" variability="discrete">
      <Integer start="1"/></ScalarVariable>"""
_ITEMS = '<Item name="forward" value="1"/><Item name="backward" value="2"/>'
BINARY = '<Binary name="blob" valueReference="8" causality="input"/>'
SIZE = '<UInt64 name="size" valueReference="9" causality="structuralParameter" start="2"/>'
CLOCK = '<Clock name="tick" valueReference="7" causality="input" intervalVariability="constant" intervalDecimal="1"/>'


def nothing_known(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's cache, from now on, in which nothing is known of any FMU; what is built is shared with all tests."""
    usual, own = (Path(each) / "quadcosim" for each in (platformdirs.user_cache_dir(), folder))
    own.mkdir(parents=True)
    for name in ("batch", "built", "lanes", "loader", "loop", "native", "scheduler", "timetable"):
        (usual / name).mkdir(parents=True, exist_ok=True)
        (own / name).symlink_to(usual / name)
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    return folder


def small(
    folder: Path,
    *habits: str,
    fmi: int = 2,
    fixed_step: bool = False,
    once: bool = False,
    saves: bool = True,
    more: str = "",
    tolerance: float | None = None,
    mode_is_input: bool = False,
    forged: bool = False,
) -> Path:
    """The FMU with these habits (macros of `small.c`) in `folder`, with these flags in its description.

    `forged`: it says that it is built on this project's kit.
    `mode_is_input`: that of FMI 2.0 has `mode` as an Integer that others may feed, of any value.
    """
    folder.mkdir(parents=True, exist_ok=True)
    binary = _compiled(*habits, *(["FMI3"] if fmi == 3 else [])).replace(_KEPT, uuid.uuid4().hex.encode())
    state = (
        ("canGetAndSetFMUState", "canSerializeFMUState")
        if fmi == 3
        else ("canGetAndSetFMUstate", "canSerializeFMUstate")
    )
    flags = {
        "canHandleVariableCommunicationStepSize": not fixed_step,
        "canBeInstantiatedOnlyOncePerProcess": once,
        **dict.fromkeys(state, saves),
    }
    attributes = " ".join(f'{name}="{str(value).lower()}"' for name, value in flags.items())
    text = _FMI3 if fmi == 3 else _FMI2
    place = fmpy.platform_tuple if fmi == 3 else fmpy.platform
    path = folder / "small.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        if mode_is_input:
            assert _MODE in text
            text = text.replace(_MODE, _MODE_AS_INPUT)
        experiment = "" if tolerance is None else f'<DefaultExperiment tolerance="{tolerance}"/>'
        described = text.format(attributes=attributes, items=_ITEMS, more=more, experiment=experiment)
        archive.writestr("modelDescription.xml", described)
        if forged:
            archive.writestr(SOURCE_HASH_FILE, "0" * 64)
        archive.writestr(f"binaries/{place}/Small{fmpy.sharedLibraryExtension}", binary)
    return path


def known(fmu: Path) -> Path:
    """The FMU, of which it is known whether its runs repeat: else its first run finds it out, in most of a second."""
    opening.repeatability_of(fmu)
    return fmu


def _compiled(*macros: str) -> bytes:
    """The library, in which what is kept has a name that each FMU replaces by its own."""
    content = library(str(COMPILER), _SOURCE, *(f"-D{macro}" for macro in (*macros, f'KEPT="{_KEPT.decode()}"')))
    assert _KEPT in content
    return content
