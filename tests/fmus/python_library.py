"""Finding a shared libpython, which a host that is not Python needs and the `python` command may do without."""

import ctypes.util
import re
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path

OLDEST = (3, 10)
"""What the FMUs' sources need."""

FOLDERS = (
    "/usr/lib",
    "/usr/lib64",
    f"/usr/lib/{sysconfig.get_config_var('MULTIARCH')}",
    "/usr/local/lib",
    "/opt/homebrew/lib",
)


def own_library() -> Path | None:
    """The library of the Python that runs this test; None if that Python is linked statically."""
    if not sysconfig.get_config_var("Py_ENABLE_SHARED"):
        return None
    for folder in (sysconfig.get_config_var("LIBDIR"), f"{sys.base_prefix}/lib"):
        for variable in ("INSTSONAME", "LDLIBRARY"):
            path = Path(str(folder), str(sysconfig.get_config_var(variable)))
            if path.is_file() and ".so" in path.name:
                return path
    return None


def other_libraries() -> Iterator[str]:
    """Libraries of other Pythons that can run the FMU, as `dlopen` takes them, the same version first."""
    major, minor = sys.version_info[:2]
    same = ctypes.util.find_library(f"python{major}.{minor}")
    if same is not None:
        yield same
    for folder in FOLDERS:
        for path in sorted(Path(folder).glob("libpython3.*.so*"), reverse=True):
            match = re.match(r"libpython3\.(\d+)\.so", path.name)
            if match and (3, int(match[1])) >= OLDEST:
                yield str(path)
