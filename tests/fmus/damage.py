"""Ways to damage an FMU: a mutant, and the changes to its files that make it one."""

import re
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring, tostring

from fmu_kit.archive import NATIVE_TABLES, content_guid
from fmu_kit.loader import GUID_FILE
from tests.fmus.archive import files_of

DESCRIPTION = "modelDescription.xml"
Files = dict[str, bytes]
Damage = Callable[[Files], None]
"""Changes the files of an FMU in place"""

_OF_THE_TYPE = ("start", "unit", "displayUnit", "min", "max", "nominal", "quantity", "declaredType", "reinit")
"""Attributes that FMI 2.0 has at the type of a variable: another one is put at the variable itself"""


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """One way to damage an FMU, and how it must be found."""

    name: str
    rule: str
    """The rule that is meant for it"""
    words: tuple[str, ...]
    """What the text of the finding must name"""
    damage: Damage
    rule_3: str | None = None
    """The rule that is meant for it in FMI 3.0, if that is another one"""
    model: str = "QuadrotorPlant"
    damage_3: Damage | None = None
    """What does the same to an FMU of FMI 3.0, if that takes another damage"""
    versions: tuple[int, ...] = (2, 3)
    """Of FMI, in whose FMUs it can be done"""
    words_3: tuple[str, ...] | None = None
    """What it must name in FMI 3.0, if that is called otherwise"""
    keeps_guid: bool = False
    """Whether the GUID is left as the damage made it"""
    rewrite: Callable[[Path], None] | None = None
    """Damage to the archive itself"""
    time_limit: float = 20.0
    """[s]; a mutant takes one or two"""

    def rule_of(self, version: int) -> str:
        """The rule that is meant for it, in a version of FMI."""
        return self.rule if version == 2 or self.rule_3 is None else self.rule_3

    def words_of(self, version: int) -> tuple[str, ...]:
        """What the text of the finding must name, in a version of FMI."""
        return self.words if version == 2 or self.words_3 is None else self.words_3

    def write(self, fmu: Path, folder: Path) -> Path:
        """A damaged copy of `fmu` in `folder`."""
        files = files_of(fmu)
        three = version_of(fromstring(files[DESCRIPTION])) == 3
        (self.damage_3 if three and self.damage_3 is not None else self.damage)(files)
        path = folder / f"{self.name.replace(' ', '_')}.fmu"
        write_fmu(path, files if self.keeps_guid else with_its_guid(files))
        if self.rewrite is not None:
            self.rewrite(path)
        return path


def write_fmu(path: Path, files: Files) -> None:
    """An archive of the files, in their order."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)


def with_its_guid(files: Files) -> Files:
    """The files with the GUID that their content has."""
    guid = content_guid(files).encode()
    described = re.sub(rb' (guid|instantiationToken)="[^"]*"', rb' \1="' + guid + b'"', files[DESCRIPTION], count=1)
    return {**files, DESCRIPTION: described, **({} if NATIVE_TABLES in files else {GUID_FILE: guid})}


def every(*damages: Damage) -> Damage:
    """One damage after the other."""

    def damage(files: Files) -> None:
        for one in damages:
            one(files)

    return damage


# -- the description ------------------------------------------------------------------------------------


def description(change: Callable[[Element], None]) -> Damage:
    """Change the XML of the model description."""

    def damage(files: Files) -> None:
        root = fromstring(files[DESCRIPTION])
        change(root)
        files[DESCRIPTION] = tostring(root, encoding="UTF-8")

    return damage


def root(**attributes: str | None) -> Damage:
    """Set attributes of the whole; None: remove."""
    return description(lambda root: put(root, attributes))


def element(path: str, /, **attributes: str | None) -> Damage:
    """Set attributes of the first element at a path."""
    return description(lambda root: put(found(root, path), attributes))


def unit(name: str, /, **attributes: str | None) -> Damage:
    """Set attributes of the base units of a unit."""
    return element(f"UnitDefinitions/Unit[@name='{name}']/BaseUnit", **attributes)


def variable(name: str, /, **attributes: str | None) -> Damage:
    """Set attributes of a variable or of its type."""

    def change(root: Element) -> None:
        declared = found(root, f"ModelVariables/*[@name='{name}']")
        typed = declared[0] if declared.tag == "ScalarVariable" else declared
        put(declared, {key: value for key, value in attributes.items() if key not in _OF_THE_TYPE})
        put(typed, {key: value for key, value in attributes.items() if key in _OF_THE_TYPE})

    return description(change)


def version_of(root: Element) -> int:
    """2 or 3, of FMI."""
    return int(root.get("fmiVersion", "")[0])


def depends(where: str, output: str, *names: str) -> Damage:
    """The entry of an output in a list of the model structure has these dependencies alone."""
    return description(
        lambda root: entry(root, where, output).set("dependencies", " ".join(handle_of(root, name) for name in names))
    )


def unknown(where: str, name: str, /, **attributes: str | None) -> Damage:
    """Set attributes of the entry of a variable in a list of the model structure."""
    return description(lambda root: put(entry(root, where, name), attributes))


def without_unknown(where: str, name: str) -> Damage:
    """Remove the entry of a variable from a list of the model structure."""

    def change(root: Element) -> None:
        holder = f"ModelStructure/{where}" if version_of(root) == 2 else "ModelStructure"
        found(root, holder).remove(entry(root, where, name))

    return description(change)


def handle_of(root: Element, name: str) -> str:
    """By which the model structure names a variable: its place in the list, or its value reference in FMI 3.0."""
    declared = list(found(root, "ModelVariables"))
    place = [v.get("name") for v in declared].index(name)
    return str(place + 1) if version_of(root) == 2 else declared[place].get("valueReference", "")


def entry(root: Element, where: str, name: str) -> Element:
    """The entry of a variable in a list of the model structure, which is called as in FMI 2.0."""
    handle = handle_of(root, name)
    if version_of(root) == 2:
        return found(root, f"ModelStructure/{where}/Unknown[@index='{handle}']")
    return found(root, f"ModelStructure/{where.removesuffix('s')}[@valueReference='{handle}']")


def found(root: Element, path: str) -> Element:
    """The first element at a path, which must be there."""
    result = root.find(path)
    assert result is not None, path
    return result


def put(target: Element, attributes: dict[str, str | None]) -> None:
    """Set attributes, or remove those that are None, which must be there."""
    for key, value in attributes.items():
        if value is None:
            del target.attrib[key]
        else:
            target.set(key, value)


# -- the other files ------------------------------------------------------------------------------------


def source(name: str, old: str, new: str) -> Damage:
    """Replace a text in a bundled source, every time that it occurs."""

    def damage(files: Files) -> None:
        (path,) = (path for path in files if path.startswith("resources/") and path.endswith(name))
        replaced(path, old, new)(files)

    return damage


def replaced(path: str, old: str, new: str) -> Damage:
    """Replace a text in a file, every time that it occurs."""

    def damage(files: Files) -> None:
        assert old.encode() in files[path], f"{path}: expected {old!r}"
        files[path] = files[path].replace(old.encode(), new.encode())

    return damage


def file(name: str, content: bytes) -> Damage:
    """Write a file."""

    def damage(files: Files) -> None:
        files[name] = content

    return damage


def without(start: str) -> Damage:
    """Remove the files whose names start so."""

    def damage(files: Files) -> None:
        for name in list(named(files, start)):
            del files[name]

    return damage


def named(files: Files, start: str) -> Iterator[str]:
    """Names that start so, of which there must be one."""
    names = [name for name in files if name.startswith(start)]
    assert names, start
    yield from names
