"""Where FMUs are found, and when they are built."""

import os
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import platformdirs
import pytest

from fmu_kit.archive import SOURCE_HASH_FILE, read_source_hash, write_archive
from fmu_kit.bundle import Target, bundled_sources
from orchestration.components.building import builder, fmus
from orchestration.components.building.models import MODELS
from orchestration.components.fmi import trust
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.processes import subprocesses
from quadcosim import QuadcosimError, UsageError
from tests.extent import sample


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that the package takes for the one that it lies in; its cache is beside it."""
    root = tmp_path / "project"
    root.mkdir()
    monkeypatch.setattr(subprocesses, "ROOT", str(root))
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda name: str(tmp_path / "cache" / name))
    return root


def with_fmus_folder(project: Path) -> Path:
    (project / "pyproject.toml").touch()
    (project / "fmus").mkdir()
    return project / "fmus"


# -- the folder -------------------------------------------------------------------------------------------


def test_a_project_has_its_own_folder(project: Path) -> None:
    folder = with_fmus_folder(project)
    assert fmus.default_folder() == folder


def test_an_installed_package_uses_the_cache(project: Path, tmp_path: Path) -> None:
    assert fmus.default_folder() == tmp_path / "cache" / "quadcosim" / "fmus"
    (project / "fmus").mkdir()  # some folder of that name, but no project
    assert fmus.default_folder() == tmp_path / "cache" / "quadcosim" / "fmus"


def test_a_folder_that_cannot_be_written_is_not_used(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = with_fmus_folder(project)
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != folder)  # root may write anywhere
    assert fmus.default_folder() == tmp_path / "cache" / "quadcosim" / "fmus"


def test_an_fmu_is_built_into_the_cache_and_loads_from_there(project: Path, tmp_path: Path) -> None:
    path = fmus.locate("QuadrotorPlant")
    assert path == tmp_path / "cache" / "quadcosim" / "fmus" / "QuadrotorPlant.fmu"
    with Fmi2Instance(path, "plant") as plant:
        assert plant.description.modelName == "QuadrotorPlant"


# -- finding and building ---------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["QuadrotorPlant.fmu", "nowhere/UnifiedController.fmu"])
def test_a_path_of_no_file_is_refused_in_a_few_words(path: str) -> None:
    with pytest.raises(UsageError) as refused:
        fmus.locate(path)
    assert str(refused.value) == f"fmu = {path}: no such file, and no module beside it that defines the slave"


@pytest.mark.parametrize("name", ["Unified", "", "README.md"])
def test_a_name_that_there_is_none_of_is_refused_with_the_names_there_are(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "README.md").touch()
    with pytest.raises(UsageError) as refused:
        fmus.locate(name)
    assert str(refused.value).startswith(f"fmu = {name}: expected ")
    with pytest.raises(UsageError, match=r"^components.tank.fmu = "):
        fmus.of_components({"tank": name})
    assert all(model in str(refused.value) for model in MODELS)
    assert ".fmu" in str(refused.value)


def test_a_path_is_taken_as_it_is(built: dict[str, Path]) -> None:
    path = str(built["QuadrotorPlant"])
    assert fmus.locate(path) == Path(path)


def test_a_missing_fmu_is_built_and_announced_once(project: Path) -> None:
    folder = with_fmus_folder(project)
    reported: list[str] = []
    for _ in range(2):
        assert fmus.locate("UnifiedController", reported.append) == folder / "UnifiedController.fmu"
    assert len(reported) == 1
    assert reported[0] == f"building {folder / 'UnifiedController.fmu'}"
    assert [path.name for path in folder.iterdir()] == ["UnifiedController.fmu"]


@pytest.mark.parametrize("content", [b"", b"no archive", None])
def test_an_fmu_that_is_not_of_these_sources_is_built_anew(
    project: Path, built: dict[str, Path], content: bytes | None
) -> None:
    """None: another FMU under this name, which carries another hash."""
    path = with_fmus_folder(project) / "QuadrotorPlant.fmu"
    path.write_bytes(built["UnifiedController"].read_bytes() if content is None else content)
    assert builder.out_of_date(["QuadrotorPlant"], path.parent) == ["QuadrotorPlant"]
    fmus.locate("QuadrotorPlant")
    assert builder.out_of_date(["QuadrotorPlant"], path.parent) == []
    assert path.read_bytes() == built["QuadrotorPlant"].read_bytes()


def test_modification_times_do_not_matter(project: Path, built: dict[str, Path]) -> None:
    path = with_fmus_folder(project) / "QuadrotorPlant.fmu"
    path.write_bytes(built["QuadrotorPlant"].read_bytes())
    os.utime(path, (0, 0))
    assert builder.out_of_date(["QuadrotorPlant"], path.parent) == []


@pytest.mark.parametrize("model", MODELS)
def test_no_source_of_an_fmu_is_outside_the_packages_whose_files_are_looked_at(model: str) -> None:
    target = Target.parse(MODELS[model])
    assert {place.partition("/")[0] for place in bundled_sources(target)} <= {*builder.packages_of(target)}


def test_sources_are_read_again_when_a_file_beside_them_is_another_or_there_is_one_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "own_plant"
    read: list[Target] = []
    (package / "parts").mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "slave.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(MODELS, "OwnPlant", "own_plant.slave:OwnPlant")

    def source_hash(target: Target) -> str:
        read.append(target)
        return "of another FMU than there is"

    packing = replace(builder.IN_PYTHON, source_hash=source_hash)

    def times() -> int:
        for _ in range(2):
            assert builder.out_of_date(["OwnPlant"], tmp_path, packing) == ["OwnPlant"]
        return len(read)

    assert times() == 1
    (package / "slave.py").write_text("x = 1\n")
    assert times() == 2
    os.utime(package / "slave.py", (0, 0))
    assert times() == 3
    (package / "parts" / "more.py").touch()
    assert times() == 4
    (package / "parts" / "more.py").write_text("y = 2\n")
    assert times() == 5
    monkeypatch.setenv("PATH", "")
    assert times() == 6


def builds_by(code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In place of what packs slaves, a process with this code."""
    monkeypatch.setattr(subprocesses, "command", lambda *_: [sys.executable, "-c", code])


def test_a_build_that_fails_says_why_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    output = "Traceback …\ncontroller_fmu/sliding_mode/law.py:3: imports numpy\n"
    builds_by(f"import sys; sys.stderr.reconfigure(encoding='utf-8'); sys.exit({output!r})", monkeypatch)
    with pytest.raises(QuadcosimError, match=r"failed: controller_fmu/sliding_mode/law.py:3: imports numpy$"):
        builder.build(["UnifiedController"], tmp_path)


def test_a_build_says_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    builds_by("print('a.fmu'); print('# B: compiling'); print('b.fmu')", monkeypatch)
    reported: list[float | str] = []
    slaves = [Target("lamps", "A"), Target("lamps", "B")]
    built = builder.build_slaves(slaves, tmp_path, reported.append, progress=reported.append)
    assert built == [Path("a.fmu"), Path("b.fmu")]
    assert reported == [0.5, "B: compiling", 1.0]


# -- slaves of anybody ------------------------------------------------------------------------------------

LAMP = """
from fmu_kit.interface import Input, Output
from fmu_kit.slave import Slave
from voltage import VOLTS


class Lamp(Slave):
    '''A lamp.'''

    voltage = Output("at the lamp", "{unit}")
    switch = Input("whether it is on", start=False, variability="discrete")

    def step(self, t: float, h: float) -> None:
        self.voltage = VOLTS * self.switch
"""


@pytest.fixture
def lamp(tmp_path: Path) -> Path:
    """A folder with a slave of a few lines, which uses a module beside it."""
    folder = tmp_path / "lamp"
    folder.mkdir()
    (folder / "lamp.py").write_text(LAMP.format(unit="V"), encoding="utf-8")
    (folder / "voltage.py").write_text("VOLTS = 12.0\n", encoding="utf-8")
    return folder


def test_a_missing_fmu_is_built_from_the_slave_beside_it_and_again_when_that_changes(lamp: Path) -> None:
    path = lamp / "Lamp.fmu"
    reported: list[str] = []
    for _ in range(2):
        assert fmus.locate(str(path), reported.append) == path
    assert reported == [f"building {path}"]
    assert not trust.is_own(path)
    (lamp / "voltage.py").write_text("VOLTS = 24.0\n", encoding="utf-8")
    fmus.locate(str(path), reported.append)
    assert reported == [f"building {path}"] * 2
    with Fmi2Instance(path, "lamp") as instance:
        instance.enter_initialization(0.0, 1.0)
        instance.exit_initialization()
        instance.set("switch", True)
        instance.step(0.0, 0.1)
        assert instance.get("voltage") == 24.0


@pytest.mark.parametrize(("folder", "version"), [("native", "2.0"), ("native/fmi3", "3.0")])
def test_without_python_inside_it_is_built_into_a_folder_beside_the_slave(
    folder: str, version: str, lamp: Path
) -> None:
    path = lamp / folder / "Lamp.fmu"
    reported: list[str] = []
    for _ in range(2):
        assert fmus.locate(str(path), reported.append) == path
    assert reported == [f"building {path}"]
    assert read_model(path).description.fmiVersion == version
    assert fmus.native_twin(str(path)) == str(path)
    assert fmus.native_twin(str(lamp / "Lamp.fmu")) == str(lamp / "native" / "Lamp.fmu")


def test_somebody_elses_fmu_is_left_as_it_is_beside_a_slave_of_its_name(lamp: Path) -> None:
    (lamp / "Lamp.fmu").write_bytes(b"of another tool")
    assert fmus.locate(str(lamp / "Lamp.fmu")).read_bytes() == b"of another tool"


@pytest.mark.parametrize(
    "packing", sample([builder.IN_PYTHON, builder.NATIVE, builder.NATIVE_FMI_3], 1), ids=lambda each: each.folder
)
def test_a_variant_is_built_again_with_its_values_when_its_sources_change(packing: builder.Packing, lamp: Path) -> None:
    law = (lamp / "lamp.py").read_text(encoding="utf-8").replace("import Input,", "import Input, Parameter,")
    law = law.replace("VOLTS *", "self.share * VOLTS *").replace(
        "    switch", '    share = Parameter("of it", "1", start=1.0)\n    switch'
    )
    (lamp / "lamp.py").write_text(law, encoding="utf-8")
    (slave,) = builder.slaves_of(lamp)
    folder = lamp / packing.folder
    (path,) = builder.build_slaves([builder.with_fixed(slave, "Dim", {"share": 0.5})], folder, packing=packing)
    reported: list[str] = []
    assert fmus.locate(str(path), reported.append) == path
    assert reported == []
    before = read_source_hash(path)
    (lamp / "voltage.py").write_text("VOLTS = 24.0\n", encoding="utf-8")
    for _ in range(2):
        assert fmus.locate(str(path), reported.append) == path
    assert reported == [f"building {path}"]
    assert read_source_hash(path) != before
    assert (read_model(path).variables["share"].is_constant, read_model(path).variables["share"].start) == (True, "0.5")


def test_sources_in_a_folder_are_read_again_when_they_or_what_lies_beside_them_change(tmp_path: Path) -> None:
    read: list[Target] = []

    def source_hash(target: Target) -> str:
        read.append(target)
        return str(len(read))

    packing = replace(builder.IN_PYTHON, source_hash=source_hash)
    (tmp_path / "slave.py").touch()

    def times() -> int:
        for _ in range(2):
            builder._source_hash(packing, Target("slave", "OwnPlant", tmp_path))
        return len(read)

    assert times() == 1
    (tmp_path / "slave.py").write_text("x = 1\n")
    assert times() == 2
    (tmp_path / "more.py").touch()
    assert times() == 3
    (tmp_path / "OwnPlant.png").touch()
    assert times() == 4
    (tmp_path / "OwnPlant.fmu").touch()
    assert times() == 4
    (tmp_path / "OwnPlant.html").touch()
    assert times() == 6, "its page may include any file"
    (tmp_path / "OwnPlant.html").unlink()
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "__init__.py").touch()
    assert times() == 8, "a package may have any"


def test_the_hash_of_sources_is_kept_for_other_processes_while_no_file_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "own_law" / "__init__.py"
    source.parent.mkdir()
    source.write_text("GAIN = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    computed: list[str] = []

    def hash_now(target: Target) -> str:
        computed.append(source.read_text())
        return f"{len(computed):064x}"

    def in_another_process() -> str:
        builder._cached_source_hash.cache_clear()
        return builder._source_hash(replace(builder.IN_PYTHON, source_hash=hash_now), Target("own_law", "Law"))

    assert in_another_process() == in_another_process() == f"{1:064x}"
    before = source.stat()
    source.write_text("GAIN = 2\n")
    os.utime(source, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert in_another_process() == f"{2:064x}"
    assert computed == ["GAIN = 1\n", "GAIN = 2\n"]


def with_another_hash(path: Path) -> bytes:
    """An FMU as if it were of other sources; its new content."""
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    write_archive(path, {**files, SOURCE_HASH_FILE: b"of others"}, first="modelDescription.xml")
    return path.read_bytes()


def test_a_variant_of_this_projects_is_built_again_in_its_folder_and_elsewhere_only_said_to_be_old(
    project: Path, tmp_path: Path
) -> None:
    (slave,) = builder.slaves_named("QuadrotorPlant")
    target = builder.with_fixed(slave, "Heavy", {"mass": 2.0})
    own, elsewhere = builder.build_slaves([target], with_fmus_folder(project)) + builder.build_slaves(
        [target], tmp_path
    )
    built, reported = own.read_bytes(), list[str]()
    fmus.locate(str(elsewhere), reported.append)
    assert reported == []
    old = with_another_hash(elsewhere)
    own.write_bytes(old)
    fmus.locate(str(own), reported.append)
    fmus.locate(str(elsewhere), reported.append)
    assert reported == [
        f"building {own}",
        f"{elsewhere} was built of other sources than the current ones: expected quadcosim build --name Heavy again",
    ]
    assert (own.read_bytes(), elsewhere.read_bytes()) == (built, old)


def test_a_slave_that_cannot_be_built_is_an_error_of_one_line(lamp: Path) -> None:
    (lamp / "lamp.py").write_text(LAMP.format(unit="furlong"), encoding="utf-8")
    with pytest.raises(QuadcosimError, match=r"failed: .*lamp.py, line 10: ValueError: unit furlong: expected"):
        fmus.locate(str(lamp / "Lamp.fmu"))
    (lamp / "voltage.py").write_text("import numpy\n", encoding="utf-8")
    with pytest.raises(QuadcosimError, match=r"voltage.py:1: imports numpy, but an FMU has the standard library only$"):
        fmus.locate(str(lamp / "Lamp.fmu"))


def test_every_slave_of_a_folder_is_built_into_it_unless_told(lamp: Path, tmp_path: Path) -> None:
    assert builder.build_slaves(builder.slaves_of(lamp), lamp) == [lamp / "Lamp.fmu"]
    assert builder.build_slaves(builder.slaves_of(lamp), tmp_path / "out") == [tmp_path / "out" / "Lamp.fmu"]
    assert (tmp_path / "out" / "Lamp.fmu").read_bytes() == (lamp / "Lamp.fmu").read_bytes()


@pytest.mark.parametrize("folder", ["nowhere", "."])
def test_a_folder_without_slaves_is_wrong_usage(folder: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r": expected a "):
        builder.slaves_of(tmp_path / folder)


def test_a_slave_that_leaves_a_method_open_is_told_which(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text("from fmu_kit.slave import Slave\nclass Law(Slave): ...\n", encoding="utf-8")
    for text in (tmp_path, tmp_path / "Law"):
        with pytest.raises(UsageError, match=r"^Law has no step: expected a slave in .* to define it$"):
            builder.slaves_named(str(text))
