"""FMUs in C as other tools make them: one source, compiled with one fault or habit each."""

import re
import shutil
from pathlib import Path

import fmpy
import pytest

from tests.fmus.damage import DESCRIPTION, write_fmu
from tests.native import library

COMPILER = shutil.which("gcc") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

_SOURCE = Path(__file__).with_name("foreign.c")

DESCRIBED = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Lag" guid="{lag}">
  <CoSimulation modelIdentifier="Lag" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"
    canSerializeFMUstate="true"/>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.01"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="1" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="tau" valueReference="2" causality="parameter" variability="fixed"><Real start="0.1"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs>
    <InitialUnknowns><Unknown index="2"/></InitialUnknowns></ModelStructure>
</fmiModelDescription>
"""


def lag(path: Path, *macros: str, described: dict[str, str] | None = None) -> Path:
    """The FMU at `path`, compiled with `macros`, texts of its description replaced."""
    binary = library(str(COMPILER), _SOURCE, *(f"-D{macro}" for macro in macros))
    text = DESCRIBED
    for old, new in (described or {}).items():
        text, count = re.subn(re.escape(old), lambda _, new=new: new, text)  # type: ignore[misc]
        assert count, f"{old}: not in the description"
    files = {DESCRIPTION: text.encode(), f"binaries/{fmpy.platform}/Lag{fmpy.sharedLibraryExtension}": binary}
    write_fmu(path, files)
    return path
