"""Packing a slave as an .fmu: the same sources give the same bytes, and no module name can clash with another FMU's.

At run time pythonfmu puts an FMU's `resources` first on `sys.path` and imports its module by name, in an interpreter
that all FMUs and the host share. So all Python that an FMU contains, pythonfmu's own and the entry script included,
lies in one package whose name has the hash of its content. For that, and for a reproducible archive, pythonfmu's
builder is not used: it packs plain names and refuses a slave whose base class has been renamed. Its slave base and its
binaries are used unchanged.

Packing imports the slave, so it runs in a separate process: `python -m fmu_kit.packaging`.
"""

import hashlib
import importlib
import importlib.metadata
import inspect
import json
import posixpath
import re
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.dom.minidom import parseString
from xml.etree.ElementTree import Element, ParseError, fromstring, tostring

from fmu_kit import archive, bundle, documentation, loader
from fmu_kit.archive import ICONS, PAGE, SOURCE_HASH_FILE, VARIANT_FILE, content_guid, write_archive
from fmu_kit.assigned_names import expect_declared
from fmu_kit.bundle import PackagingError, Target, bundled_sources, module_path, path_in_bundle, rename_imports
from fmu_kit.documentation import BuildNotes
from fmu_kit.errors import FmuError
from fmu_kit.failure import place_of
from fmu_kit.new_files import WriteError
from fmu_kit.variants import Variant
from fmu_kit.versions import generation_tool, version_of
from fmu_kit.write_description import GUID_PLACEHOLDER, PYTHON_REQUIRED, to_xml

_LICENCES = {
    "quadcosim": "quadcosim, which packed this FMU.",
    "pythonfmu": "pythonfmu, which connects it to FMI.",
}
_LICENCE_OF_THE_MODEL = "The licence of the model itself is named in modelDescription.xml.\n"

_ENTRY = Path(__file__).with_name("entry.tmpl")
"""Template of the module that pythonfmu runs in an FMU."""


def source_hash(target: Target) -> str:
    """The hash of all that the content of the FMU depends on: its modules and other files, and the packaging."""
    own = (
        Path(__file__),
        Path(archive.__file__),
        Path(bundle.__file__),
        Path(documentation.__file__),
        documentation.TEMPLATE,
        documentation.IN_PYTHON,
        Path(loader.__file__),
        loader.SOURCE,
        _ENTRY,
    )
    return hash_of(target, own, {"compiler": str(loader.compiler() is not None)}, unchanged_files(target))


def hash_of(target: Target, packaging: Iterable[Path], facts: dict[str, str], unchanged: dict[str, bytes]) -> str:
    """The hash of a slave's modules, of the packaging's files, of `facts`, and of the files packed unchanged."""
    digest = hashlib.sha256()
    texts = bundled_sources(target) | {_place_in_kit(path): _text(path) for path in packaging}
    texts |= {"tool": generation_tool(), **facts}
    for name, text in {**texts, "fragment": fragment_of(target)}.items():
        digest.update(f"{name}\0{text}\0".encode())
    for name, content in unchanged.items():
        digest.update(name.encode() + b"\0" + hashlib.sha256(content).digest())
    return digest.hexdigest()


def _place_in_kit(path: Path) -> str:
    return path.relative_to(Path(__file__).parent).as_posix()


def origin(target: Target, digest: str) -> dict[str, bytes]:
    """The files, by path, that record an FMU's origin: the hash of its sources, and for a variant its slave."""
    files = {SOURCE_HASH_FILE: digest.encode()}
    if target.variant is not None:
        files[VARIANT_FILE] = json.dumps([f"{target.module}:{target.model}", target.variant.text]).encode()
    return files


def build(target: Target, folder: Path) -> Path:
    """Write `folder`/Model.fmu and return its path."""
    sources = bundled_sources(target)
    digest = source_hash(target)
    name = f"quadcosim_{digest[:16]}"
    entry = f"{name}_entry"
    files = {f"resources/{name}/{path}": rename_imports(text, name, target).encode() for path, text in sources.items()}
    files[f"resources/{name}/__init__.py"] = b""
    files[f"resources/{entry}.py"] = _entry(name, target).encode()
    files["resources/slavemodule.txt"] = entry.encode()
    files |= origin(target, digest)
    files |= _with_loader(unchanged_files(target), target.name)
    notes = BuildNotes(
        needs=documentation.IN_PYTHON,
        source=f"../resources/{name}/{path_in_bundle(target.module, target.root)}",
        status="fmi2Fatal",
        afterwards="Switch logging on to see the log. After a failure, do not call the instance again: make a new one.",
    )
    add_description(files, target, notes, to_xml(slave_class(target)))
    files[loader.GUID_FILE] = insert_guid(files).encode()
    return write_fmu(files, target, folder)


def add_description(files: dict[str, bytes], target: Target, notes: BuildNotes, description: Element) -> None:
    """Add the description and the page of a slave to the files of its FMU; raises `PackagingError` for dead links."""
    page = documentation.to_html(slave_class(target), notes, _well_formed_fragment(target))
    files[PAGE] = page.encode()
    for link in documentation.files_linked(page):
        if posixpath.normpath(posixpath.join(posixpath.dirname(PAGE), link)) not in files:
            raise PackagingError(f"{target.fragment}: links to {link}, which is not in the FMU")
    description.set("generationTool", generation_tool())
    if version := version_of(slave_class(target)):
        description.set("version", version)
    text = parseString(tostring(description)).toprettyxml(indent="  ", encoding="UTF-8")
    files["modelDescription.xml"] = text


def insert_guid(files: dict[str, bytes]) -> str:
    """Insert the GUID of the content into the description, and return it."""
    guid = content_guid(files)
    files["modelDescription.xml"] = files["modelDescription.xml"].replace(GUID_PLACEHOLDER.encode(), guid.encode())
    return guid


def write_fmu(files: dict[str, bytes], target: Target, folder: Path) -> Path:
    """Write the FMU and return its path."""
    path = folder / f"{target.name}.fmu"
    write_archive(path, files, first="modelDescription.xml")
    return path


def _entry(bundle: str, target: Target) -> str:
    """The module that pythonfmu runs; its syntax is that of the oldest Python that could load it."""
    oldest = tuple(map(int, PYTHON_REQUIRED.removeprefix(">=").split(".")))
    entry = _ENTRY.read_text(encoding="utf-8")
    return entry.format(bundle=bundle, module=target.entry, model=target.name, oldest=oldest, required=PYTHON_REQUIRED)


def slave_class(target: Target) -> Any:
    """The class; raises `PackagingError` if its module fails, or if the class is abstract or has no description."""
    try:
        slave = getattr(importlib.import_module(target.module), target.model, None)
    except Exception as error:
        raise PackagingError(f"{place_of(error)}{type(error).__name__}: {error}") from error
    if slave is None:
        raise PackagingError(f"{target.module}: expected a class {target.model}")
    if inspect.isabstract(slave):
        left = ", ".join(sorted(slave.__abstractmethods__))
        raise PackagingError(f"{target.module}:{target.model}: expected it to define {left}")
    try:
        expect_declared(slave)
    except AttributeError as error:
        raise PackagingError(str(error)) from error
    if "description" not in vars(slave):
        raise PackagingError(f"{target.module}:{target.model}: expected a docstring or a description")
    try:
        inspect.signature(slave).bind(instance_name=target.model, resources="")
    except TypeError as error:
        raise PackagingError(
            f"{target.module}:{target.model}.__init__: {error}: expected none, as memory from step to step is a Local "
            "and what follows from parameters is computed in read_parameters; or (self, **kwargs), passed on to "
            "super().__init__"
        ) from error
    return slave if target.variant is None else _variant(slave, target.variant)


def _variant(slave: Any, variant: Variant) -> Any:
    """The class with fixed values; raises `PackagingError` for values that it refuses."""
    attributes = {"fixed": dict(variant.fixed), "description": variant.describe(slave.__name__)}
    try:
        subclass = type(variant.name, (slave,), {**attributes, "__module__": slave.__module__})
        subclass(instance_name=variant.name)._take_parameters()
    except FmuError as error:
        raise PackagingError(f"{variant.name}: {error}") from error
    return subclass


def _binaries(model: str) -> dict[str, bytes]:
    """pythonfmu's binaries, by path in the FMU of `model`."""
    folder = module_path("pythonfmu").parent / "resources" / "binaries"
    return {
        f"binaries/{path.parent.name}/{model}{path.suffix}": path.read_bytes()
        for path in sorted(folder.glob("*/*"))
        if path.suffix in (".so", ".dll", ".dylib")
    }


def _with_loader(files: dict[str, bytes], model: str) -> dict[str, bytes]:
    """The files with the loader in front of pythonfmu's library for Linux; unchanged where it cannot be compiled."""
    try:
        return loader.with_loader(files, model)
    except loader.LoaderError as error:
        print(
            f"{model}.fmu: packed without its loader ({error}); a host that is not Python must load Python itself",
            file=sys.stderr,
        )
        return files


def unchanged_files(target: Target) -> dict[str, bytes]:
    """The files packed unchanged, by path in the FMU: binaries, licences, the slave's icon if it has one."""
    return {**_binaries(target.name), **licences_and_icon(target, pythonfmu=_license_of_pythonfmu())}


def licences_and_icon(target: Target, version: int = 2, **others: str) -> dict[str, bytes]:
    """The licences, with a list of them, and the slave's icon if it has one, by path in an FMU of a version of FMI.

    `others`: the texts of licences beside that of quadcosim, by name.
    """
    texts = {"quadcosim": _text(Path(__file__).with_name("LICENSE")), **others}
    texts["license"] = "".join(f"{name}.txt: {_LICENCES[name]}\n" for name in texts) + _LICENCE_OF_THE_MODEL
    files = {f"documentation/licenses/{name}.txt": text.encode() for name, text in texts.items()}
    if target.icon.is_file():
        files[ICONS[version]] = target.icon.read_bytes()
    return files


def fragment_of(target: Target) -> str:
    """The hand-written part of the documentation; empty if there is none.

    `<?include PATH?>` in it is replaced by that file, which several slaves may share, from the folder of the slave or
    else of this package.
    """

    def shared(found: re.Match[str]) -> str:
        beside = target.fragment.parent / found[1]
        return _text(beside if beside.is_file() else Path(__file__).parent / found[1])

    text = _text(target.fragment) if target.fragment.is_file() else ""
    return re.sub(r"<\?include (\S+)\?>", shared, text)


def _well_formed_fragment(target: Target) -> str:
    """The hand-written part of the documentation; raises `PackagingError` if it is not well-formed XML."""
    fragment = fragment_of(target)
    try:
        fromstring(f"<body>{fragment}</body>")
    except ParseError as error:
        raise PackagingError(f"{target.fragment}: {error}; expected well-formed XML") from error
    return fragment


def _text(path: Path) -> str:
    """The text of a file, with the same line ends on every system."""
    return path.read_text(encoding="utf-8")


def _license_of_pythonfmu() -> str:
    """The licence of pythonfmu, which must go with every copy of it."""
    distribution = importlib.metadata.distribution("pythonfmu")
    text = distribution.read_text("licenses/LICENSE") or distribution.read_text("LICENSE")
    if text is None:
        raise PackagingError("pythonfmu: its licence file is not installed with it")
    return text


REMARK = "# "
"""the beginning of a printed line that is not the path of a file"""


def main(arguments: list[str], build: Callable[[Target, Path], Path] = build) -> int:
    """`python -m fmu_kit.packaging FOLDER [--root ROOT] [--variant TEXT] MODULE:CLASS …`: build each, print its path.

    ROOT is the folder that is searched for modules first, TEXT that of a `Variant`.
    """
    folder, *targets = arguments
    root, variant = None, None
    if targets[:1] == ["--root"]:
        root, targets = Path(targets[1]), targets[2:]
        sys.path.insert(0, str(root))
    if targets[:1] == ["--variant"]:
        variant, targets = Variant.parse(targets[1]), targets[2:]
    try:
        for text in targets:
            print(build(replace(Target.parse(text, root), variant=variant), Path(folder)), flush=True)
    except (PackagingError, WriteError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
