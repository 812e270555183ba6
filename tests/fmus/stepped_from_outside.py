"""FMUs of which the importer does more than to step them, as `exchange.c` has them, with all that FMI has them list."""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from tests.fmus.archive import files_of
from tests.fmus.damage import DESCRIPTION, description, found, handle_of, write_fmu
from tests.orchestration.components.fmi.exchange import clock, exchange, law, partitions

BALL, LAW, JOBS = "Ball", "Law", "Jobs"
"""For model exchange; with an input clock, and with partitions, of FMI 3.0"""
_STATES = ("dx1", "dx2")


def stepped_from_outside(version: int, folder: Path) -> dict[str, Path]:
    """Those of a version of FMI, by name."""
    (folder / "as_written").mkdir()
    paths = {BALL: exchange(folder / "as_written", "ball", fmi=version)}
    if version == 3:
        paths[LAW] = law(folder / "as_written", clock("r"))
        paths[JOBS] = partitions(folder / "as_written")
    return {name: _whole(path, folder / f"{name}.fmu") for name, path in paths.items()}


def _whole(fmu: Path, path: Path) -> Path:
    files = files_of(fmu)
    assert DESCRIPTION in files
    description(_list_all)(files)
    write_fmu(path, files)
    return path


def _list_all(root: Element) -> None:
    """List each output, state and unknown of the initialisation, without dependencies: it may depend on all."""
    structure, declared = found(root, "ModelStructure"), found(root, "ModelVariables")
    structure.clear()
    is_ball, two = root.get("modelName") == BALL, root.get("fmiVersion") == "2.0"
    if not is_ball:
        SubElement(declared, "Float64", name="time", valueReference="0", causality="independent")
        found(root, "ModelVariables/*[@name='y']").set("initial", "exact")
    outputs = [v.get("name", "") for v in declared if v.get("causality") == "output"]
    calculated = {*outputs, *_STATES} if is_ball else {*outputs} - {"y"}
    if root.get("modelName") == "Clocks":
        calculated = set()  # what ticks is not there before
    unknowns = [name for v in declared if (name := v.get("name", "")) in calculated]
    derivatives = _STATES if is_ball else ()
    lists = (("Outputs", "Output", outputs), ("Derivatives", "ContinuousStateDerivative", derivatives))
    for plural, single, names in (*lists, ("InitialUnknowns", "InitialUnknown", unknowns)):
        into = SubElement(structure, plural) if two else structure
        for name in names:
            key = "index" if two else "valueReference"
            SubElement(into, "Unknown" if two else single, {key: handle_of(root, name)})
    if is_ball and not two:
        SubElement(structure, "EventIndicator", valueReference="1")
