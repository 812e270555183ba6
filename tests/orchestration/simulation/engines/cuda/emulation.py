"""Emulation of a GPU by the CPU: its driver, and the CUDA text compiled as C++."""

import hashlib
import subprocess
from pathlib import Path

from fmu_kit.compiler.pack.c_compiler import compiled_here

DRIVER = "gpu.so"
HERE = Path(__file__).parent
_CPP = ("-x", "c++", "-std=gnu++20", "-O0", "-ffp-contract=off", "-fPIC", "-shared", "-include", "processor.h")


def has_cpp() -> bool:
    """Whether this machine's compiler supports C++."""
    tried = subprocess.run(["cc", "-x", "c++", "-fsyntax-only", "-"], input=b"", capture_output=True, check=False)
    return tried.returncode == 0


def make_driver(folder: Path) -> None:
    """Write the library that replaces the driver to a folder."""
    sources = {"gpu.c": (HERE / "gpu.c").read_bytes()}
    (folder / DRIVER).write_bytes(compiled_here(sources, "gpu.c", options=("-fvisibility=default",)))


def compiled_for_cpu(text: str, folder: Path) -> bytes:
    """The path, for `cuModuleLoadData`, of a text compiled for the CPU."""
    path = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.so"
    if not path.exists():
        source = path.with_suffix(".cu")
        source.write_text(text, encoding="utf-8")
        subprocess.run(["cc", *_CPP, "-I", str(HERE), str(source), "-o", str(path)], check=True)
    return str(path).encode() + b"\0"
