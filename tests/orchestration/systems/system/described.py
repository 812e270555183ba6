"""FMUs that consist of a model description only, for code that reads nothing else."""

from collections.abc import Mapping
from pathlib import Path

from fmu_kit.archive import write_archive

UNITS = """<UnitDefinitions>
  <Unit name="m"><BaseUnit m="1"/></Unit>
  <Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>
  <Unit name="s"><BaseUnit s="1"/></Unit>
  <Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit>
  <Unit name="K"><BaseUnit K="1"/></Unit>
  <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
  <Unit name="m/s2"><BaseUnit m="1" s="-2"/></Unit>
  <Unit name="m/s^2"><BaseUnit m="1" s="-2"/></Unit>
</UnitDefinitions>"""


def described(
    folder: Path,
    model: str,
    *,
    inputs: Mapping[str, str] = {},
    outputs: Mapping[str, str] = {},
    parameters: Mapping[str, str] = {},
    experiment: str = "",
) -> Path:
    """An FMU `model`.fmu in `folder`; each variable is given as `TYPE [UNIT] [discrete]`, by its name."""
    variables: list[str] = []
    for causality, given in (("input", inputs), ("output", outputs), ("parameter", parameters)):
        for name, text in given.items():
            kind, *rest = text.split()
            discrete = causality != "parameter" and (kind != "Real" or "discrete" in rest)
            unit = "".join(f' unit="{word}"' for word in rest if word != "discrete")
            start = {"Boolean": "false", "String": ""}.get(kind, "0")
            variability = "fixed" if causality == "parameter" else "discrete" if discrete else "continuous"
            initial = "" if causality == "output" else f' start="{start}"'
            variables.append(
                f'<ScalarVariable name="{name}" valueReference="{len(variables)}" causality="{causality}" '
                f'variability="{variability}"><{kind}{unit}{initial}/></ScalarVariable>'
            )
    text = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{model}" guid="{model}">
<CoSimulation modelIdentifier="{model}" canHandleVariableCommunicationStepSize="true"/>
{UNITS}
{f"<DefaultExperiment {experiment}/>" if experiment else ""}
<ModelVariables>{"".join(variables)}</ModelVariables>
<ModelStructure/>
</fmiModelDescription>"""
    path = folder / f"{model}.fmu"
    write_archive(path, {"modelDescription.xml": text.encode()}, first="modelDescription.xml")
    return path
