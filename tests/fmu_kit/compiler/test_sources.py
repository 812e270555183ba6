"""The sources in a native FMU are all that it takes to make its library again."""

import shutil
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest
from elftools.elf.elffile import ELFFile

from orchestration.components.building import builder, fmus
from tests.extent import sample
from tests.fmus.process import run

MODEL = "QuadrotorPlant"


@pytest.mark.skipif(shutil.which("cmake") is None or shutil.which("cc") is None, reason="no cmake, or no C compiler")
@pytest.mark.parametrize("folder", sample([builder.NATIVE.folder, builder.NATIVE_FMI_3.folder], 1))
def test_what_fmpy_compiles_flies_to_the_same_bytes_and_needs_no_libm(folder: str, tmp_path: Path) -> None:
    built = fmus.locate(f"{folder}/{MODEL}")
    path = tmp_path / f"{MODEL}.fmu"
    with zipfile.ZipFile(built) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            if not name.startswith("binaries/"):
                target.writestr(name, source.read(name))
    done = run(sys.executable, "-m", "fmpy", "compile", str(path))
    assert done.returncode == 0, done.stdout + done.stderr
    flights = [fmpy.simulate_fmu(str(fmu), stop_time=1.0, output_interval=0.01) for fmu in (path, built)]
    assert len(flights[0]) == 101
    assert flights[0].tobytes() == flights[1].tobytes()
    unpacked = Path(fmpy.extract(str(path), str(tmp_path / "unpacked")))
    (library,) = (unpacked / "binaries").glob("*/*.so")
    with library.open("rb") as stream:
        tags = ELFFile(stream).get_section_by_name(".dynamic").iter_tags()
        assert [tag.needed for tag in tags if tag.entry.d_tag == "DT_NEEDED"] == ["libc.so.6"]
