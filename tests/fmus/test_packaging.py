"""Packing: same sources, same bytes, and nothing in an FMU that another could answer for."""

import ast
import datetime
import io
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import fmpy
import pytest

from fmu_kit import bundle
from fmu_kit.archive import content_guid
from fmu_kit.loader import BESIDE, GUID_FILE
from orchestration.components.building import builder
from orchestration.components.building.models import MODELS
from orchestration.components.checks.doctor import binaries
from orchestration.foundation.basics.errors import QuadcosimError
from tests.extent import in_test_all, sample
from tests.fmus.archive import files_of
from tests.fmus.instance import Instance
from tests.fmus.process import run
from tests.fmus.source_tree import build, copy_sources, python, replace, try_to_build

EPOCH = 1_000_000_000  # 2001-09-09T01:46:40Z


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy of the sources that a test may change."""
    return copy_sources(tmp_path / "sources")


@pytest.fixture(autouse=True)
def no_source_date(monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment of a packager must not decide these tests."""
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)


def hashes_of(sources: Path) -> dict[str, str]:
    """The hash of what each model is made of, in a copy of the sources."""
    program = (
        "import sys; from fmu_kit import packaging as p\n"
        "for target in sys.argv[1:]: print(p.source_hash(p.Target.parse(target)))"
    )
    done = python(sources, "-c", program, *MODELS.values())
    assert done.returncode == 0, done.stderr
    return dict(zip(MODELS, done.stdout.split(), strict=True))


@pytest.fixture(scope="module")
def before(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The hashes of a copy that nobody has changed."""
    return hashes_of(copy_sources(tmp_path_factory.mktemp("unchanged")))


# -- reproducible ---------------------------------------------------------------------------------------


@pytest.fixture
def nothing_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All is compiled anew: the user's cache is empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.mark.usefixtures("nothing_kept")
def test_building_again_in_another_folder_gives_the_same_bytes(built: dict[str, Path], tmp_path: Path) -> None:
    for path in builder.build(sample([*MODELS], 1), tmp_path / "elsewhere"):
        assert path.read_bytes() == built[path.stem].read_bytes()


@in_test_all
@pytest.mark.usefixtures("nothing_kept")
def test_building_again_in_the_same_folder_gives_the_same_bytes(tmp_path: Path) -> None:
    (path,) = builder.build(["QuadrotorPlant"], tmp_path)
    first = path.read_bytes()
    shutil.rmtree(tmp_path / "cache")
    (again,) = builder.build(["QuadrotorPlant"], tmp_path)
    assert again == path
    assert again.read_bytes() == first


@in_test_all
def test_a_copied_source_tree_gives_the_same_bytes(built: dict[str, Path], sources: Path, tmp_path: Path) -> None:
    assert try_to_build(sources, tmp_path, *MODELS).returncode == 0
    for model in MODELS:
        assert (tmp_path / f"{model}.fmu").read_bytes() == built[model].read_bytes(), model


def test_the_copied_tree_is_what_is_built_and_of_other_sources_it_is_out_of_date(
    built: dict[str, Path], sources: Path, tmp_path: Path
) -> None:
    shutil.copy(built["QuadrotorPlant"], tmp_path)
    replace(sources / "controller_fmu" / "sliding_mode" / "law.py", "model.mass * n  #", "2.0 * model.mass * n  #")
    fmu = build(sources, tmp_path, "UnifiedController")
    assert fmu.read_bytes() != built["UnifiedController"].read_bytes()
    assert any(b"2.0 * model.mass * n" in content for content in files_of(fmu).values())
    assert builder.out_of_date(["UnifiedController", "QuadrotorPlant"], tmp_path) == ["UnifiedController"]


@pytest.mark.parametrize("model", MODELS)
def test_without_a_source_date_the_date_is_1980(model: str, built: dict[str, Path]) -> None:
    assert fmpy.read_model_description(str(built[model])).generationDateAndTime == "1980-01-01T00:00:00Z"


def test_source_date_epoch_sets_the_date_and_does_not_change_the_guid(
    built: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", str(EPOCH))
    (path,) = builder.build(["QuadrotorPlant"], tmp_path)
    dated, plain = (fmpy.read_model_description(str(each)) for each in (path, built["QuadrotorPlant"]))
    expected = datetime.datetime.fromtimestamp(EPOCH, datetime.timezone.utc)
    assert dated.generationDateAndTime == expected.strftime("%Y-%m-%dT%H:%M:%SZ") == "2001-09-09T01:46:40Z"
    assert dated.guid == plain.guid


# -- content --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_the_guid_is_that_of_the_content(model: str, built: dict[str, Path]) -> None:
    guid = fmpy.read_model_description(str(built[model])).guid
    assert guid
    assert guid == content_guid(files_of(built[model]))


def test_the_guid_changes_with_any_file(built: dict[str, Path]) -> None:
    files = files_of(built["QuadrotorPlant"])
    guid = content_guid(files)
    assert files.pop(GUID_FILE).decode() == guid
    for name in files:
        assert content_guid({**files, name: files[name] + b" "}) != guid, name


@pytest.mark.parametrize("model", MODELS)
def test_every_bundled_module_lives_under_a_name_with_the_hash(model: str, built: dict[str, Path]) -> None:
    files = files_of(built[model])
    digest = files["resources/source_hash.txt"].decode()
    bundle = f"quadcosim_{digest[:16]}"
    modules = [PurePosixPath(name) for name in files if name.endswith(".py")]
    tops = {path.relative_to("resources").parts[0] for path in modules}
    assert tops == {bundle, f"{bundle}_entry.py"}
    assert files["resources/slavemodule.txt"].decode() == f"{bundle}_entry"


@pytest.mark.parametrize("model", MODELS)
def test_bundled_sources_import_only_the_standard_library_and_the_bundle(model: str, built: dict[str, Path]) -> None:
    files = files_of(built[model])
    bundle = f"quadcosim_{files['resources/source_hash.txt'].decode()[:16]}"
    sources = {name: content for name, content in files.items() if name.endswith(".py")}
    imported = {module for content in sources.values() for module in imported_modules(content)}
    assert imported - sys.stdlib_module_names == {bundle}


def imported_modules(source: bytes) -> Iterator[str]:
    """The top-level packages of all absolute imports, at any depth of the code."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            assert node.module is not None
            yield node.module.partition(".")[0]


@pytest.mark.parametrize("model", MODELS)
def test_every_import_from_the_bundle_finds_a_bundled_file(model: str, built: dict[str, Path]) -> None:
    files = files_of(built[model])
    bundle = f"quadcosim_{files['resources/source_hash.txt'].decode()[:16]}"
    for name, content in files.items():
        for node in ast.walk(ast.parse(content)) if name.endswith(".py") else ():
            if isinstance(node, ast.ImportFrom) and node.level == 0 and str(node.module).startswith(bundle):
                path = "resources/" + str(node.module).replace(".", "/")
                assert f"{path}.py" in files or f"{path}/__init__.py" in files, f"{name}: {node.module}"


@pytest.mark.parametrize("model", MODELS)
def test_what_only_building_needs_is_not_bundled(model: str, built: dict[str, Path]) -> None:
    bundled = {PurePosixPath(name).name for name in files_of(built[model]) if "/fmu_kit/" in name}
    assert "slave.py" in bundled
    assert not bundled & {"packaging.py", "bundle.py", "discovery.py", "documentation.py", "page.html"}


@pytest.mark.parametrize("model", MODELS)
def test_the_archive_has_the_licence_of_pythonfmu(model: str, built: dict[str, Path]) -> None:
    licence = files_of(built[model])["documentation/licenses/pythonfmu.txt"].decode()
    assert "Permission is hereby granted, free of charge" in licence
    assert "Copyright" in licence


@pytest.mark.parametrize("model", MODELS)
def test_the_archive_has_a_binary_named_after_the_model_for_linux_and_windows(
    model: str, built: dict[str, Path]
) -> None:
    binaries = {name for name in files_of(built[model]) if name.startswith("binaries/")}
    assert {f"binaries/linux64/{model}.so", f"binaries/win64/{model}.dll"} <= binaries


@pytest.mark.parametrize("compiler", sample(["none", "one that fails"], 1))
def test_without_a_compiler_an_fmu_is_packed_without_a_loader_and_says_so(
    compiler: str, built: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    if compiler != "none":
        (tools / "cc").write_text("#!/bin/sh\necho no headers >&2\nexit 1\n")
        (tools / "cc").chmod(0o755)
    monkeypatch.setenv("PATH", str(tools))
    said: list[str] = []
    (path,) = builder.build(["QuadrotorPlant"], tmp_path, said.append)
    why = "no C compiler that is called cc" if compiler == "none" else f"{tools}/cc: no headers"
    assert said == [
        f"QuadrotorPlant.fmu: packed without its loader ({why}); a host that is not Python must load Python itself"
    ]
    with_one, without = files_of(built["QuadrotorPlant"]), files_of(path)
    assert {name for name in without if "quadcosim_" not in name} == {
        name for name in with_one if "quadcosim_" not in name and name != BESIDE
    }
    assert without["binaries/linux64/QuadrotorPlant.so"] == with_one[BESIDE]
    assert builder.out_of_date(["QuadrotorPlant"], tmp_path) == []
    with Instance(path) as instance:
        instance.initialise({})


@pytest.mark.parametrize("model", MODELS)
def test_the_loader_asks_for_no_newer_c_library_than_its_calls_need(model: str, built: dict[str, Path]) -> None:
    binary = binaries.read(io.BytesIO(files_of(built[model])[f"binaries/linux64/{model}.so"]))
    (needed,) = binary.dependencies or ()
    assert needed.name == "libc.so.6"
    (newest,) = binaries.newest(needed.versions)
    assert tuple(map(int, newest.removeprefix("GLIBC_").split("."))) <= (2, 34)
    assert binary.python_symbols == ()


@pytest.mark.parametrize("model", MODELS)
def test_a_python_that_is_too_old_is_refused_in_a_sentence(model: str, built: dict[str, Path], tmp_path: Path) -> None:
    fmpy.extract(str(built[model]), str(tmp_path))
    (entry,) = (tmp_path / "resources").glob("*_entry.py")
    old = f"import sys; sys.version_info = (3, 9, 18); sys.version = '3.9.18 (main)'; import {entry.stem}"
    done = run(sys.executable, "-c", old, cwd=entry.parent)
    assert done.stderr.splitlines()[-1] == f"ImportError: {model}.fmu: expected Python >=3.10, found 3.9.18"


# -- refused --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("statement", "module"),
    [
        ("import numpy", "numpy"),
        ("import math, numpy.linalg as la", "numpy.linalg"),
        ("from numpy import array", "numpy"),
        ("def late():\n    import numpy", "numpy"),
        ("from orchestration.components.building.models import MODELS", "orchestration.components.building.models"),
    ],
)
def test_a_slave_that_needs_more_than_the_standard_library_is_refused(
    statement: str, module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "thirsty_fmu"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "slave.py").write_text("from thirsty_fmu.helper import late\n")
    (package / "helper.py").write_text(f"{statement}\n")  # found though the slave imports it only indirectly
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(bundle.PackagingError) as refusal:
        bundle.bundled_sources(bundle.Target("thirsty_fmu.slave", "Thirsty"))
    assert str(package / "helper.py") in str(refusal.value)
    assert f"imports {module}," in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_the_command_refuses_a_slave_that_imports_numpy_in_one_line(sources: Path, tmp_path: Path) -> None:
    law = sources / "controller_fmu" / "sliding_mode" / "law.py"
    replace(law, "from typing import NamedTuple\n", "from typing import NamedTuple\n\nimport numpy as np\n")
    done = try_to_build(sources, tmp_path / "out", "UnifiedController")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert str(law) in line
    assert "numpy" in line
    assert not (tmp_path / "out" / "UnifiedController.fmu").exists()


def test_an_import_that_renaming_would_miss_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "plain_fmu"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "slave.py").write_text("import fmu_kit.algebra\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(bundle.PackagingError, match=r"slave\.py:1: expected `from package\.module import name`"):
        bundle.bundled_sources(bundle.Target("plain_fmu.slave", "Plain"))


def test_a_module_without_sources_is_refused_by_name() -> None:
    with pytest.raises(bundle.PackagingError, match="no_such_package"):
        bundle.bundled_sources(bundle.Target("no_such_package.slave", "Slave"))


@pytest.mark.parametrize(
    "text", ["controller_fmu.sliding_mode.slave", ":UnifiedController", "controller_fmu.sliding_mode.slave:", ""]
)
def test_a_target_must_name_module_and_class(text: str) -> None:
    with pytest.raises(bundle.PackagingError, match="expected module:Class"):
        bundle.Target.parse(text)


def test_a_failed_build_says_why(sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MODELS, "Missing", "controller_fmu.no_such_module:Missing")
    with pytest.raises(QuadcosimError, match=r"building .*failed: .*no_such_module"):
        builder.build(["Missing"], tmp_path)


# -- out of date ----------------------------------------------------------------------------------------


def test_the_source_hash_changes_with_a_source(before: dict[str, str], sources: Path) -> None:
    replace(sources / "plant_fmu" / "wind.py", "amplitude: Vec3 = Vec3(0.01, ", "amplitude: Vec3 = Vec3(0.02, ")
    after = hashes_of(sources)
    assert {model for model in MODELS if after[model] != before[model]} == {"QuadrotorPlant"}


@pytest.mark.parametrize(
    "file",
    sample(
        ["packaging.py", "bundle.py", "documentation.py", "page.html", "loader.py", "loader.c", "LICENSE", "slave.py"],
        2,
    ),
)
def test_the_source_hash_changes_with_what_both_fmus_stand_on(file: str, before: dict[str, str], sources: Path) -> None:
    with (sources / "fmu_kit" / file).open("a", encoding="utf-8") as source:
        source.write("# changed\n")
    after = hashes_of(sources)
    assert all(after[model] != before[model] for model in MODELS)


@pytest.mark.parametrize("file", sample(["QuadrotorPlant.html", "QuadrotorPlant.png"], 1))
def test_the_source_hash_changes_with_the_files_beside_the_slave(
    file: str, before: dict[str, str], sources: Path
) -> None:
    path = sources / "plant_fmu" / file
    path.write_bytes(path.read_bytes() + b"\n")
    changed = hashes_of(sources)
    assert {model for model in MODELS if changed[model] != before[model]} == {"QuadrotorPlant"}
    path.unlink()
    plants = {hashes["QuadrotorPlant"] for hashes in (before, changed, hashes_of(sources))}
    assert len(plants) == 3


def test_fresh_fmus_are_up_to_date(built: dict[str, Path]) -> None:
    assert builder.out_of_date(MODELS, built["QuadrotorPlant"].parent) == []


@pytest.mark.parametrize("content", [None, b"", b"no archive"])
def test_a_missing_or_broken_fmu_is_out_of_date(content: bytes | None, tmp_path: Path) -> None:
    if content is not None:
        (tmp_path / "QuadrotorPlant.fmu").write_bytes(content)
    assert builder.out_of_date(["QuadrotorPlant"], tmp_path) == ["QuadrotorPlant"]


def test_building_replaces_an_fmu_and_leaves_nothing_else(built: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "QuadrotorPlant.fmu"
    path.write_bytes(b"not an archive")
    assert builder.build(["QuadrotorPlant"], tmp_path) == [path]
    assert path.read_bytes() == built["QuadrotorPlant"].read_bytes()
    assert list(tmp_path.iterdir()) == [path]
