"""The documentation in an FMU: true, complete, and all there for whoever has nothing but the .fmu."""

import ast
import itertools
import posixpath
import re
import shutil
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, fromstring

import fmpy
import numpy as np
import pytest
from fmpy.model_description import ModelVariable
from fmpy.validation import validate_fmu

from fmu_kit.trajectory import Trajectory
from orchestration.components.building.models import MODELS
from orchestration.quadrotor.scenarios.wiring import COMMAND, MEASUREMENT
from tests.fmus.archive import files_of
from tests.fmus.instance import Instance
from tests.fmus.making import PAIR
from tests.fmus.process import run
from tests.fmus.source_tree import copy_sources, python
from tests.places import ROOT

SOURCES = {
    "UnifiedController": "controller_fmu/sliding_mode/law.py",
    "GeometricController": "controller_fmu/geometric/law.py",
    "CascadedController": "controller_fmu/cascaded/rate_loop.py",
    "QuadrotorPlant": "fmu_kit/rigid_body.py",
}
"""Where the equations of each FMU are."""


class Documented(NamedTuple):
    """An FMU, and its page as XML."""

    model: str
    fmu: Path
    files: dict[str, bytes]
    page: Element

    @property
    def text(self) -> str:
        """What is read on the page."""
        return "".join(self.page.itertext())

    @property
    def links(self) -> list[str]:
        """The targets of all links."""
        return [a.attrib["href"] for a in self.page.iter("a")]

    @property
    def example(self) -> str:
        """The program on the page."""
        (program,) = (pre for pre in self.page.iter("pre") if pre.get("id") == "program")
        return "".join(program.itertext())


def documented(fmu: Path) -> Documented:
    files = files_of(fmu)
    return Documented(fmu.stem, fmu, files, fromstring(files["documentation/index.html"].decode()))


@pytest.fixture(params=MODELS)
def of(request: pytest.FixtureRequest, built: dict[str, Path]) -> Documented:
    """Each FMU in turn."""
    return documented(built[request.param])


# -- the page -------------------------------------------------------------------------------------------------


def test_the_page_is_titled_by_the_model_and_says_its_encoding(of: Documented) -> None:
    head, body = of.page
    assert (of.page.tag, head.tag, body.tag) == ("html", "head", "body")
    assert head[0].attrib == {"charset": "utf-8"}
    assert head.findtext("title") == body.findtext("h1") == of.model
    assert fmpy.read_model_description(str(of.fmu)).description in of.text


def test_nothing_is_loaded_from_anywhere(of: Documented) -> None:
    assert {element.tag for element in of.page.iter() if "href" in element.attrib} == {"a"}
    forbidden = {"script", "link", "img", "iframe", "object", "embed", "audio", "video", "source", "form", "base"}
    assert not forbidden & {element.tag for element in of.page.iter()}
    attributes = {name for element in of.page.iter() for name in element.attrib}
    assert attributes == {"lang", "charset", "name", "content", "href", "id", "class"}
    assert not re.search(r"url|@import|expression", of.page.findtext("head/style", ""))


def test_links_lead_to_files_of_the_archive_to_sections_of_the_page_or_to_the_web(of: Documented) -> None:
    ids = [element.attrib["id"] for element in of.page.iter() if "id" in element.attrib]
    assert len(ids) == len(set(ids))
    for link in of.links:
        if link.startswith("#"):
            assert link[1:] in ids
        elif not link.startswith("https://"):
            assert posixpath.normpath(posixpath.join("documentation", link)) in of.files, link


def test_every_section_is_in_the_contents(of: Documented) -> None:
    sections = {f"#{heading.attrib['id']}": heading.text for heading in of.page.iter("h2")}
    assert {"#what", "#wiring", "#example", "#step", "#departures", "#variables", "#errors", "#needs"} <= set(sections)
    links = {a.attrib["href"]: a.text or "" for a in of.page.iter("a") if a.attrib["href"].startswith("#")}
    assert {target: " ".join(text.split()) for target, text in links.items()} == sections


def test_the_page_links_to_the_readable_equations(of: Documented) -> None:
    (link,) = (link for link in of.links if link.endswith(SOURCES[of.model]))
    bundled = of.files[posixpath.normpath(posixpath.join("documentation", link))].decode()
    functions = {node.name for node in ast.walk(ast.parse(bundled)) if isinstance(node, ast.FunctionDef)}
    assert functions & {"evaluate", "derivative", "control_rate"}


@pytest.mark.parametrize("of", PAIR, indirect=True)  # those whose sources number them
def test_every_equation_of_the_sources_is_on_the_page(of: Documented) -> None:
    in_source = set(equation_numbers((ROOT / SOURCES[of.model]).read_text(encoding="utf-8")))
    cells = [row[-1].text or "" for row in of.page.iterfind(".//table[@class='equations']/tr")]
    assert len(in_source) >= 2
    assert in_source <= set(equation_numbers(" ".join(cells)))


def equation_numbers(text: str) -> Iterator[int]:
    """Those in brackets, `(19)-(21)` being three."""
    for first, last in re.findall(r"\((\d+)\)(?:[-–]\((\d+)\))?", text):
        yield from range(int(first), int(last or first) + 1)


# -- the variables --------------------------------------------------------------------------------------------


def expanded(name: str) -> list[str]:
    """The variables of a row: `position.{x,y,z}` is three."""
    vector, brace, axes = name.partition("{")
    return [f"{vector}{axis}" for axis in axes.rstrip("}").split(",")] if brace else [name]


def tables(page: Element) -> Iterator[tuple[str, list[dict[str, str]]]]:
    """The rows of each table of variables by column, with the heading above it."""
    body = page.findall("body/*")
    for heading, block in itertools.pairwise(body):
        if heading.tag == "h3" and (match := re.fullmatch(r"(\w+)s \((\d+)\)", heading.text or "")):
            head, *rows = (["".join(cell.itertext()) for cell in row] for row in block.iter("tr"))
            yield match[1].lower(), [dict(zip(head, row, strict=True)) for row in rows]
            assert sum(len(expanded(row[0])) for row in rows) == int(match[2])


def described(page: Element) -> dict[str, tuple[Any, ...]]:
    """What the page says of each variable."""
    found: dict[str, tuple[Any, ...]] = {}
    for causality, rows in tables(page):
        for row in rows:
            names = expanded(row["Name"])
            starts = row.get("Start", "").split(", ")
            for name, start in zip(names, starts if len(starts) > 1 else starts * len(names), strict=True):
                assert name not in found
                bounds = (row.get(key, "").removeprefix("> ") for key in ("Min", "Max"))
                numbers = (number(text) for text in (start, *bounds))
                found[name] = (causality, row["Unit"], *numbers, row["Variability"], row["Description"])
    return found


def number(text: str | None) -> float | bool | str | None:
    """The value that a text stands for; the name of an item for itself."""
    if text in ("true", "false"):
        return text == "true"
    return text if text and text.isidentifier() else float(text) if text else None


def start_of(variable: ModelVariable) -> str | None:
    """As the page has it: by its item for an Enumeration."""
    items = {item.value: item.name for item in getattr(variable.declaredType, "items", ())}
    return items.get(variable.start, variable.start)


def test_the_page_says_of_every_variable_what_the_model_description_says(of: Documented) -> None:
    expected = {
        v.name: (
            *(v.causality, v.unit or v.type),
            *(number(text) for text in (start_of(v), v.min, v.max)),
            *(v.variability, v.description),
        )
        for v in fmpy.read_model_description(str(of.fmu)).modelVariables
    }
    assert described(of.page) == expected


def test_a_bound_that_is_excluded_is_told_from_one_that_is_allowed(of: Documented) -> None:
    lowest = {row["Name"]: row.get("Min") for _, rows in tables(of.page) for row in rows}
    assert (lowest["mass"], lowest["gravity"]) == ("> 0", "0")


# -- wiring, and the example ----------------------------------------------------------------------------------


def test_the_wiring_is_that_of_the_master(of: Documented) -> None:
    body = of.page.findall("body/*")
    start = next(i for i, element in enumerate(body) if element.get("id") == "wiring")
    block = next(element for element in body[start:] if element.tag == "div")
    connected: dict[str, list[str]] = {}
    for row in block.iter("tr"):
        texts = ["".join(cell.itertext()) for cell in row]
        if row[0].tag == "th":
            names = connected.setdefault(texts[0], [])
        else:
            assert texts[0] == texts[1]
            names += expanded(texts[0])
    assert connected == {"from the plant": list(MEASUREMENT), "from the controller": list(COMMAND)}


def test_all_pages_show_the_same_example(built: dict[str, Path]) -> None:
    assert len({documented(fmu).example for fmu in built.values()}) == 1


WITHOUT_THE_PROJECT = """\
import sys
sys.modules.update(dict.fromkeys(("fmu_kit", "controller_fmu", "plant_fmu", "orchestration", "pythonfmu")))
"""
"""Lets every import of these fail."""


@pytest.mark.parametrize("of", ["UnifiedController"], indirect=True)
def test_the_example_flies_with_the_two_fmus_and_fmpy_alone(
    of: Documented, built: dict[str, Path], data: Path, tmp_path: Path
) -> None:
    for fmu in built.values():
        shutil.copy(fmu, tmp_path)
    done = run(sys.executable, "-c", WITHOUT_THE_PROJECT + of.example, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    position = [float(text) for text in re.findall(r"-?\d+\.\d+", done.stdout)]
    reference = np.genfromtxt(data / "closed_loop_10ms.csv", delimiter=",", names=True)[-1]
    assert reference["time"] == 30.0
    assert position == pytest.approx([reference[f"position{axis}"] for axis in "xyz"], abs=1e-9)
    assert "({:.3f}, {:.3f}, {:.3f})".format(*position).replace("-", "−") in of.text
    assert np.linalg.norm(np.subtract(position, [*Trajectory().position(30.0)])) == pytest.approx(1e-3, rel=0.4)
    assert {path.name for path in tmp_path.iterdir()} == {*PAIR, *(f"{model}.fmu" for model in MODELS)}


def test_the_example_could_not_have_imported_the_project() -> None:
    done = run(sys.executable, "-c", WITHOUT_THE_PROJECT + "import fmu_kit.errors")
    assert "ModuleNotFoundError" in done.stderr


# -- icon and licences ----------------------------------------------------------------------------------------


def test_the_icon_is_a_small_square_png(of: Documented) -> None:
    icon = of.files["model.png"]
    assert icon[:8] == b"\x89PNG\r\n\x1a\n"
    assert icon[12:16] == b"IHDR"
    assert struct.unpack(">II", icon[16:24]) == (256, 256)
    assert icon.endswith(b"IEND\xaeB`\x82")
    assert len(icon) < 10_000


def test_the_icons_differ(built: dict[str, Path]) -> None:
    assert len({files_of(fmu)["model.png"] for fmu in built.values()}) == len(built)


def test_the_licence_of_the_project_is_in_the_archive(of: Documented) -> None:
    licence = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert of.files["documentation/licenses/quadcosim.txt"].decode() == licence
    assert fmpy.read_model_description(str(of.fmu)).license in licence


def test_the_entry_of_the_licences_and_the_page_name_all_of_them(of: Documented) -> None:
    folder = "documentation/licenses/"
    names = {name.removeprefix(folder) for name in of.files if name.startswith(folder)} - {"license.txt"}
    assert names == {"quadcosim.txt", "pythonfmu.txt"}
    entry = of.files[f"{folder}license.txt"].decode()
    assert {line.partition(":")[0] for line in entry.splitlines() if ": " in line} == names
    assert {f"licenses/{name}" for name in names} <= set(of.links)


# -- a slave of somebody else ---------------------------------------------------------------------------------

SLAVE = """
from fmu_kit.interface import FixedParameter, Output
from fmu_kit.slave import Slave


class Still(Slave):
    a = Output("x & <y>", "m", variability="continuous")
    p = FixedParameter("alike but for the start", "1", name="near.p", minimum=-1e-7)
    q = FixedParameter("alike but for the start", "1", 1.0000001, name="near.q", minimum=-1e-7)
    r = FixedParameter("not alike", "1", name="near.r")
    switch = FixedParameter("on", start=True)

    description = "Does <nothing> & ends"
    author = "Somebody & \\"else\\""
    license = "All <rights>"
    initial_outputs_depend_on_inputs = False

    def read_parameters(self): pass

    def initialise(self, t): pass

    def step(self, t, h): pass

    def internal_state(self): return {}

    def restore(self, state): pass
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Sources with a package `other_fmu` that has a slave and nothing else."""
    sources = copy_sources(tmp_path / "sources")
    package = sources / "other_fmu"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "slave.py").write_text(SLAVE, encoding="utf-8")
    return sources


def packed(tree: Path, tmp_path: Path) -> Documented:
    done = python(tree, "-m", "fmu_kit.packaging", str(tmp_path), "other_fmu.slave:Still")
    assert done.returncode == 0, done.stderr
    return documented(Path(done.stdout.strip()))


def test_a_slave_without_the_files_is_packed_with_a_page_and_no_icon(tree: Path, tmp_path: Path) -> None:
    still = packed(tree, tmp_path)
    assert validate_fmu(str(still.fmu)) == []
    assert "model.png" not in still.files
    assert [heading.attrib["id"] for heading in still.page.iter("h2")] == ["variables", "errors", "needs", "licences"]
    assert {"documentation/licenses/quadcosim.txt", "documentation/licenses/pythonfmu.txt"} <= set(still.files)
    with Instance(still.fmu) as instance:
        instance.initialise({"near.q": 0.5})
        instance.step(0.0, 0.01)
        assert instance.get("a", "near.q") == [0.0, 0.5]


def test_texts_with_signs_of_html_are_shown_as_they_are(tree: Path, tmp_path: Path) -> None:
    still = packed(tree, tmp_path)
    for text in ("Does <nothing> & ends", 'Somebody & "else"', "All <rights>"):
        assert text in still.text
    assert described(still.page) == {
        "a": ("output", "m", None, None, None, "continuous", "x & <y>"),
        "near.p": ("parameter", "1", 0.0, -1e-7, None, "fixed", "alike but for the start"),
        "near.q": ("parameter", "1", 1.0000001, -1e-7, None, "fixed", "alike but for the start"),
        "near.r": ("parameter", "1", 0.0, None, None, "fixed", "not alike"),
        "switch": ("parameter", "Boolean", True, None, None, "fixed", "on"),
    }


def test_what_is_written_by_hand_may_link_to_the_files_beside_it(tree: Path, tmp_path: Path) -> None:
    (tree / "other_fmu" / "Still.html").write_text(
        '<h2 id="own">Own</h2><p><a href="slave.py">a</a> <a href="../fmu_kit/units.py">b</a> <a href="#own">c</a> '
        '<a href="https://fmi-standard.org">d</a> costs 5$ and $more</p>'
    )
    still = packed(tree, tmp_path)
    test_links_lead_to_files_of_the_archive_to_sections_of_the_page_or_to_the_web(still)
    assert [link for link in still.links if link.endswith("/units.py")]
    assert {"#own", "https://fmi-standard.org"} <= set(still.links)
    assert "costs 5$ and $more" in still.text


def test_what_is_written_by_hand_must_be_well_formed(tree: Path, tmp_path: Path) -> None:
    fragment = tree / "other_fmu" / "Still.html"
    fragment.write_text("<p>\n<br></p>")
    done = python(tree, "-m", "fmu_kit.packaging", str(tmp_path), "other_fmu.slave:Still")
    assert done.returncode == 1
    assert done.stderr == f"{fragment}: mismatched tag: line 2, column 6; expected well-formed XML\n"
    assert not list(tmp_path.glob("*.fmu"))


def test_a_link_to_a_file_that_is_not_packed_is_refused(tree: Path, tmp_path: Path) -> None:
    fragment = tree / "other_fmu" / "Still.html"
    fragment.write_text('<p><a href="law.py#L1">the law</a></p>')
    done = python(tree, "-m", "fmu_kit.packaging", str(tmp_path), "other_fmu.slave:Still")
    assert done.returncode == 1
    assert done.stderr.startswith(f"{fragment}: links to ../resources/quadcosim_")
    assert done.stderr.endswith("/other_fmu/law.py, which is not in the FMU\n")


SECOND = """
from controller_fmu.sliding_mode.slave import UnifiedController


class Second(UnifiedController):
    description = "Another controller"
"""


def test_a_second_controller_beside_the_first_has_nothing_of_its_page_icon_and_description(
    tree: Path, tmp_path: Path
) -> None:
    source = tree / "controller_fmu" / "second.py"
    source.write_text(SECOND, encoding="utf-8")
    done = python(tree, "-m", "fmu_kit.packaging", str(tmp_path), "controller_fmu.second:Second")
    assert done.returncode == 0, done.stderr
    second = documented(Path(done.stdout.strip()))
    assert "model.png" not in second.files
    assert [heading.attrib["id"] for heading in second.page.iter("h2")] == ["variables", "errors", "needs", "licences"]
    assert "Another controller" in second.text
    source.write_text(SECOND.replace("description =", "subtitle ="), encoding="utf-8")
    done = python(tree, "-m", "fmu_kit.packaging", str(tmp_path), "controller_fmu.second:Second")
    assert (done.returncode, done.stderr) == (
        1,
        "controller_fmu.second:Second: expected a docstring or a description\n",
    )
