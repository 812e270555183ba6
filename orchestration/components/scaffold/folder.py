"""`quadcosim new`: writes a folder with a slave, its test, a system that uses it and a page of commands."""

import importlib.util
import keyword
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from string import Template
from typing import Literal

from fmu_kit.new_files import clear, new_files, write_atomically
from orchestration.components.building import consent
from orchestration.components.building.models import MODELS, WRAPPED
from orchestration.foundation.basics.errors import UsageError

Kind = Literal["controller", "plant", "filter"]
_HERE = Path(__file__).parent


_IN_PYTHON = {
    "{module}.py": "{kind}_law.py",
    "test_{module}.py": "{kind}_test.py",
    "system.toml": "{kind}_system.toml",
    "README.md": "{kind}_README.md",
}
_FOR_A_PLANT = {
    "{module}.py": "for_plant_law.py",
    "system.toml": "for_plant_system.toml",
    "README.md": "for_plant_README.md",
}
_IN_C = {
    "{module}.c": "c_{kind}_law.c",
    "{module}.h": "c_{kind}_law.h",
    "{module}.toml": "c_{kind}_wrap.toml",
    "test_{module}.py": "c_{kind}_test.py",
    "system.toml": "{kind}_system.toml",
    "README.md": "c_{kind}_README.md",
}
_IN_C_FOR_A_PLANT = {
    "{module}.c": "c_for_plant_law.c",
    "{module}.h": "c_for_plant_law.h",
    "{module}.toml": "c_for_plant_wrap.toml",
    "system.toml": "for_plant_system.toml",
    "README.md": "for_plant_README.md",
}
"""Templates by the file that is written"""


def write(
    kind: Kind,
    name: str,
    where: Path,
    *,
    author: str,
    license: str,
    in_c: bool = False,
    of_plant: Mapping[str, str] | None = None,
) -> list[Path]:
    """Write the folder `where`/`name`; the paths of its files.

    A controller may be `in_c`, and for a plant, of which the templates need texts: `of_plant`.

    The class has the name in CamelCase, its module in snake_case. Raises `UsageError` for an invalid name, or if the
    folder exists.
    """
    model = class_name(name)
    module = module_name(model)
    _expect_usable(name, model, module)
    folder = where / name
    expect_new(folder)
    names = {"Name": model, "module": module, "folder": name, "author": _quoted(author), "license": _quoted(license)}
    names |= {"guard": module.upper(), "fmu": f"{module}{WRAPPED}" if in_c else f"{model}.fmu"}
    names |= {"source": f"{module}.{'c' if in_c else 'py'}"}
    names |= of_plant or {}
    in_python, in_c_ = (_IN_PYTHON, _IN_C) if of_plant is None else (_FOR_A_PLANT, _IN_C_FOR_A_PLANT)
    templates = in_c_ if in_c else in_python
    files = {key.format(module=module): value.format(kind=kind) for key, value in templates.items()}
    with new_files(where) as new:
        for file, template in files.items():
            text = (_HERE / f"{template}.tmpl").read_text(encoding="utf-8")
            write_atomically(new / name / file, Template(text).substitute(names))
    consent.agree(folder)
    return [folder / file for file in files]


def expect_new(folder: Path) -> None:
    """Raise `UsageError` for a folder that exists, also if it was about to when a process was killed."""
    clear(folder.parent)
    if folder.exists():
        raise UsageError(f"{folder}: exists already; expected a folder that does not exist")


def class_name(name: str) -> str:
    """`hover_pd`, `hover-pd` and `HoverPd` are HoverPd."""
    return "".join(part[:1].upper() + part[1:] for part in re.split(r"[_-]+", name))


def module_name(model: str) -> str:
    """HoverPd is hover_pd."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", model).lower()


def git_author() -> str:
    """The user name in git's configuration; empty without git or without a name."""
    try:
        done = subprocess.run(
            ["git", "config", "user.name"], capture_output=True, text=True, encoding="utf-8", errors="replace",
            check=False,
        )  # fmt: skip
    except OSError:
        return ""
    return done.stdout.strip()


def _expect_usable(name: str, model: str, module: str) -> None:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) or not model.isidentifier():
        path = Path(name)
        elsewhere = f"; in another folder: {path.name} with --out {path.parent}" if len(path.parts) > 1 else ""
        raise UsageError(
            f"{name!a}: expected a name of letters, digits and _ that begins with a letter, as hover_pd{elsewhere}"
        )
    if model in MODELS:
        raise UsageError(f"{name}: an FMU of this project has this name; expected another one")
    taken = keyword.iskeyword(module) or module in sys.stdlib_module_names or _is_installed(module)
    if taken or model in _OF_THE_KIT:
        raise UsageError(f"{name}: {module} is a module or a keyword of Python; expected another name, as my_{module}")


_OF_THE_KIT = ("Slave", "Input", "Output", "Parameter", "State", "Local", "Vec3", "Quaternion")


def _is_installed(module: str) -> bool:
    """Whether a module of this name is installed; one in the working directory does not count."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:  # a folder that is not a package
        return False
    here = Path.cwd()
    return Path(spec.origin) not in (here / f"{module}.py", here / module / "__init__.py")


def _quoted(text: str) -> str:
    """`text` escaped for a string literal of Python."""
    return text.replace("\\", "\\\\").replace('"', '\\"')
