"""Makes the files of a release in dist/: run as `make release`.

The wheel and the sources, with the page in which the paper's flight runs, which is there by itself too; the FMUs
without Python inside, for every system that zig compiles for, an archive for each version of FMI; the two FMUs of the
paper's flight with their wiring as an SSP; and the SHA-256 of each. The same commit gives the same bytes with the same
setuptools and ziglang: every time in the files is that of the commit.
"""

import gzip
import hashlib
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from fmu_kit.archive import write_archive
from fmu_kit.versions import project_version
from orchestration.experiments.live.live import SHIPPED

ROOT = Path(__file__).resolve().parents[1]
SUMS = "SHA256SUMS"


def main(folder: Path) -> None:
    """Fill `folder`, which must be empty."""
    if folder.exists() and any(folder.iterdir()):
        raise SystemExit(f"{folder}: expected an empty folder, since all that is in it is released")
    os.environ["SOURCE_DATE_EPOCH"] = time = time_of_commit()
    os.umask(0o022)
    quadcosim("live", "--out", str(SHIPPED))
    try:
        run(sys.executable, "-m", "build", "--outdir", str(folder), str(ROOT))
        shutil.copy(SHIPPED, folder / f"quadcosim-{project_version()}.html")
    finally:
        SHIPPED.unlink()
    for archive in folder.glob("*.tar.gz"):
        normalise(archive, int(time))
    name = f"quadcosim-{project_version()}"
    with tempfile.TemporaryDirectory() as temporary:
        fmus = {version: Path(temporary) / f"fmi{version}" for version in (2, 3)}
        for version, built in fmus.items():
            quadcosim("build", "--native", "--target", "all", "--fmi", str(version), "--out", str(built))
            write_fmu_archive(built, folder / f"{name}-fmi{version}.zip")
        plant, controller = (str(fmus[2] / f"{model}.fmu") for model in ("QuadrotorPlant", "UnifiedController"))
        ssp = folder / f"{name}.ssp"
        quadcosim("ssp", "--plant", plant, "--controller", controller, "--out", str(ssp))
    (folder / SUMS).write_text(sums(folder), encoding="utf-8")
    print(sums(folder), end="")


def time_of_commit() -> str:
    """The time of the checked-out commit [s since 1970], or SOURCE_DATE_EPOCH if set."""
    return os.environ.get("SOURCE_DATE_EPOCH") or run("git", "log", "-1", "--format=%ct").strip()


def normalise(archive: Path, time: int) -> None:
    """Give every file of a .tar.gz the same time and owner, in the order of their names."""
    with tarfile.open(archive) as tar:
        files = [(entry, tar.extractfile(entry)) for entry in sorted(tar.getmembers(), key=lambda entry: entry.name)]
        contents = [(entry, None if file is None else file.read()) for entry, file in files]
    partial = archive.with_suffix(".partial")
    with (
        partial.open("wb") as raw,
        gzip.GzipFile("", "wb", fileobj=raw, mtime=time) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.GNU_FORMAT) as tar,
    ):
        for old, content in contents:
            entry = tarfile.TarInfo(old.name)
            entry.type, entry.mtime, entry.size = old.type, time, len(content or b"")
            entry.mode = 0o755 if old.isdir() or old.mode & 0o100 else 0o644
            with tempfile.TemporaryFile() as file:
                file.write(content or b"")
                file.seek(0)
                tar.addfile(entry, file)
    partial.replace(archive)


def write_fmu_archive(folder: Path, archive: Path) -> None:
    """Write the FMUs of a folder into one archive; the same FMUs give the same bytes."""
    files = {path.name: path.read_bytes() for path in folder.glob("*.fmu")}
    write_archive(archive, files, first=min(files))


def sums(folder: Path) -> str:
    """The SHA-256 of every file of a folder, in the format of `sha256sum --check`."""
    paths = sorted(path for path in folder.iterdir() if path.name != SUMS)
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in paths)


def quadcosim(*arguments: str) -> None:
    """Run the command line."""
    run(sys.executable, "-m", "quadcosim", *arguments)


def run(*command: str) -> str:
    """Run a command in the project's folder; ends the program with its exit code if it fails."""
    print("+", *command, file=sys.stderr)
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        print(done.stdout, file=sys.stderr)
        raise SystemExit(done.returncode)
    return done.stdout


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else ROOT / "dist")
