"""Files are written by `fmu_kit.new_files`, temporary folders made by `fmu_kit.scratch`; exceptions are listed."""

import ast
from collections.abc import Iterator

import pytest

from tests.places import ROOT

PRODUCT = ("quadcosim", "orchestration", "fmu_kit", "controller_fmu", "plant_fmu")
MECHANISM = ("fmu_kit/new_files.py", "fmu_kit/scratch.py")
BLOCKS = ("new_file(", "new_files(", "temporary_folder(")
WRITERS = {
    *("write_text", "write_bytes", "savefig", "savemat", "tofile", "savez", "savez_compressed", "FileHandler"),
    *("to_csv", "to_parquet", "to_excel", "to_pickle", "write_csv", "ParquetWriter", "CSVWriter"),
    *("copy2", "copyfile", "copytree", "symlink_to", "hardlink_to", "touch", "rename", "extractall"),
    *("mkdtemp", "mkstemp", "NamedTemporaryFile", "TemporaryDirectory", "TemporaryFile"),
    *("os.replace", "os.link", "os.fdopen", "np.save", "numpy.save", "pq.write_table", "shutil.copy", "shutil.move"),
    *("json.dump", "pickle.dump", "tomli_w.dump"),
}
"""Names of functions that write, move or make files, with their module where the name alone is ambiguous"""
LAST = {name.rpartition(".")[2] for name in WRITERS} | {"open", "ZipFile", "replace"}

_INTEROP = "orchestration/simulation/interop"
_RUNS = "orchestration/simulation/runs"
_OF_A_TOOL = "a process of another tool writes into the temporary folder of the comparison"
EXCEPTIONS = {
    ("fmu_kit/compiler/pack/user_objects.py", "write_text"): "into the temporary folder of the objects",
    ("orchestration/command/study_table.py", "rename"): "columns of a table",
    ("orchestration/components/building/builder.py", "TemporaryFile"): "has no name, so nothing can be left",
    ("orchestration/experiments/studies/shares.py", "rename"): "columns of a table",
    ("orchestration/experiments/studies/table.py", "to_csv"): "a method of `Result`, not of pandas",
    ("orchestration/foundation/basics/terminal.py", "FileHandler"): "a log is appended to",
    ("orchestration/foundation/basics/terminal.py", "open"): "a stream",
    ("orchestration/foundation/processes/channel.py", "os.fdopen"): "pipes",
    ("orchestration/foundation/processes/fork_server.py", "open"): "a pipe",
    (
        "orchestration/foundation/recording/tables.py",
        "ParquetWriter",
    ): "rows of a run, chunk by chunk into its new folder",
    (f"{_INTEROP}/tool_process.py", "np.save"): _OF_A_TOOL,
    (f"{_INTEROP}/tool_runs.py", "np.save"): "into the temporary folder of the comparison",
    (f"{_INTEROP}/tools/cofmupy.py", "np.save"): _OF_A_TOOL,
    (f"{_INTEROP}/tools/container.py", "copyfile"): _OF_A_TOOL,
    (f"{_INTEROP}/tools/container.py", "write_text"): _OF_A_TOOL,
    (f"{_RUNS}/run_directory.py", "rename"): "a whole run that cannot take its place is kept beside it",
    ("orchestration/simulation/workers/pool.py", "TemporaryDirectory"): "in the temporary folder of the pool",
}
"""Reasons for writing otherwise, by module and function"""


def calls(tree: ast.AST, staged: frozenset[str] = frozenset()) -> Iterator[tuple[ast.Call, frozenset[str]]]:
    """The calls in a tree, each with the names that `BLOCKS` around it have bound."""
    for node in ast.iter_child_nodes(tree):
        inner = staged
        if isinstance(node, ast.With):
            inner |= {
                item.optional_vars.id
                for item in node.items
                if isinstance(item.optional_vars, ast.Name) and ast.unparse(item.context_expr).startswith(BLOCKS)
            }
        if isinstance(node, ast.Call):
            yield node, inner
        yield from calls(node, inner)


def writer_of(call: ast.Call) -> str | None:
    """The name of the function if the call writes, moves or makes a file."""
    last = getattr(call.func, "attr", getattr(call.func, "id", ""))
    if last not in LAST:
        return None
    name = ast.unparse(call.func)
    texts = [
        each.value for each in [*call.args, *(one.value for one in call.keywords)] if isinstance(each, ast.Constant)
    ]
    modes = [each for each in texts if isinstance(each, str) and len(each) <= 3 and set(each) <= set("rwxabt+")]
    if name in WRITERS or last in WRITERS:
        return name if name in WRITERS else last
    if last in ("open", "ZipFile", "fdopen") and any(set(mode) & set("wxa+") for mode in modes):
        return last
    is_path = (
        last == "replace"
        and name not in ("replace", "dataclasses.replace")
        and len(call.args) == 1
        and not call.keywords
    )
    return "replace" if is_path else None


def found_in(text: str) -> set[str]:
    """The functions that a module calls to write, but to what one of `BLOCKS` has bound."""
    return {
        name
        for call, staged in calls(ast.parse(text))
        if (name := writer_of(call)) is not None
        and not staged & {each.id for each in ast.walk(call) if isinstance(each, ast.Name)}
    }


@pytest.mark.parametrize(
    "text",
    [
        "open(path, 'w')", "path.open('xb')", "open(path, mode='a')", "path.write_text('')", "os.replace(a, b)",
        "a.replace(b)", "ZipFile(path, 'w')", "figure.savefig(path)", "frame.to_csv(path)", "json.dump(x, file)",
        "tempfile.mkdtemp()", "with new_file(path) as new:\n    other.write_text('')",
    ],
)  # fmt: skip
def test_each_way_to_write_is_found(text: str) -> None:
    assert found_in(text)


@pytest.mark.parametrize(
    "text", ["open(path)", "path.open('rb')", "a.replace('b', 'c')", "with new_file(p) as new:\n    new.write_text('')"]
)
def test_what_is_read_or_written_by_the_one_writer_is_not_found(text: str) -> None:
    assert not found_in(text)


def test_files_are_written_by_the_one_writer() -> None:
    paths = [path for package in PRODUCT for path in (ROOT / package).rglob("*.py")]
    names = {path: path.relative_to(ROOT).as_posix() for path in paths}
    found = {
        (names[path], name)
        for path in paths
        if names[path] not in MECHANISM
        for name in found_in(path.read_text(encoding="utf-8"))
    }
    assert found == set(EXCEPTIONS)
