"""FMUs of FMI 3.0 whose library commits the fault that is asked of it: `faulty_3.c` before the sound library."""

import functools
import subprocess
import tempfile
from pathlib import Path
from xml.etree.ElementTree import fromstring

import fmpy

from fmu_kit.archive import NATIVE_TABLES
from orchestration.components.building import fmus
from tests.fmus.archive import files_of
from tests.fmus.damage import DESCRIPTION, Damage, Files, file, with_its_guid, write_fmu
from tests.fmus.foreign import COMPILER

_SOURCE = Path(__file__).with_name("faulty_3.c")
_BINARIES = f"binaries/{fmpy.platform_tuple}"
_KEPT = (NATIVE_TABLES, "sources/fmi3.c", "sources/buildDescription.xml")
"""Of the sources, which are most of the archive: that it is native, and what it is compiled of"""
_NAMED = ("position.x", "position.y", "thrust", "torque.x", "mass")
"""Variables that faults are about"""


def fault(name: str) -> Damage:
    """The library commits this fault; what it can is in `faulty_3.c`."""
    assert f'is("{name}")' in _SOURCE.read_text(), name
    return file(f"{_BINARIES}/fault", name.encode())


def faulty(model: str, folder: Path) -> Path:
    """The FMU of a model in `folder`, without any fault; the GUID is that of its content."""
    files = _faulty(model)
    path = folder / f"{model}.fmu"
    write_fmu(path, files)
    return path


@functools.cache
def _faulty(model: str) -> Files:
    whole = files_of(fmus.locate(f"native/fmi3/{model}"))
    library = f"{_BINARIES}/{model}{fmpy.sharedLibraryExtension}"
    kept = {
        name: content
        for name, content in whole.items()
        if not name.startswith(("sources/", "documentation/python/", "documentation/licenses/")) or name in _KEPT
    }
    root = fromstring(whole[DESCRIPTION])
    references = {v.get("name"): v.get("valueReference") for v in root.iterfind("ModelVariables/*")}
    macros = [f"-D{name.upper().replace('.', '_')}={references.get(name, 4294967295)}u" for name in _NAMED]
    token = root.get("instantiationToken")
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "sound.so").write_bytes(whole[library])
        made = Path(folder, "library.so")
        options = ("-shared", "-fPIC", "-O1", "-w", "-Wl,-rpath,$ORIGIN", "-L", folder, "-Wl,--no-as-needed")
        subprocess.run(
            [str(COMPILER), *options, *macros, f'-DTOKEN="{token}"', str(_SOURCE), "-l:sound.so", "-o", str(made)],
            check=True,
        )
        kept |= {library: made.read_bytes(), f"{_BINARIES}/sound.so": whole[library]}
    return with_its_guid(kept)
