"""The FMU of moving.c, compiled where the tests run: it has the inputs and outputs of random systems."""

import zipfile
from pathlib import Path

import fmpy

from tests.native import library
from tests.orchestration.components.fmi.small import COMPILER

_PARAMETERS = {
    "place": 0.0,
    "fails_at": 1e9,
    "nan_at": 1e9,
    "warns_at": 1e9,
    "sample_period": 0.0,
    "sample_offset": 0.0,
}
"""With their start values; of the last two it makes nothing"""
_VARIABLE = '<ScalarVariable name="{}" valueReference="{}" causality="{}" variability="{}"><Real {}/></ScalarVariable>'


def moving(folder: Path, *, fixed_step: bool = False) -> Path:
    """The FMU in `folder`, which has code for SIMD lanes too; it declares whether it takes steps of one length only."""
    folder.mkdir(exist_ok=True)
    binary = library(str(COMPILER), Path(__file__).with_name("moving.c"))
    inputs = [f"u{i}{output}" for i in range(16) for output in "yz"]
    variables = [_VARIABLE.format(name, i, "input", "continuous", 'start="0"') for i, name in enumerate(inputs)]
    variables += [_VARIABLE.format(name, 32 + i, "output", "continuous", "") for i, name in enumerate("yz")]
    variables += [
        _VARIABLE.format(name, 34 + i, "parameter", "tunable", f'start="{value}"')
        for i, (name, value) in enumerate(_PARAMETERS.items())
    ]
    text = f"""<fmiModelDescription fmiVersion="2.0" modelName="Moving" guid="moving">
      <CoSimulation modelIdentifier="Moving" canHandleVariableCommunicationStepSize="{str(not fixed_step).lower()}"
        canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>
      <ModelVariables>{"".join(variables)}</ModelVariables>
      <ModelStructure><Outputs><Unknown index="33"/><Unknown index="34"/></Outputs>
        <InitialUnknowns><Unknown index="33" dependencies=""/><Unknown index="34" dependencies=""/></InitialUnknowns>
      </ModelStructure></fmiModelDescription>"""
    path = folder / "moving.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.writestr(f"binaries/{fmpy.platform}/Moving{fmpy.sharedLibraryExtension}", binary)
        archive.write(Path(__file__).with_name("moving_lanes.c"), "sources/lanes.c")
    return path
