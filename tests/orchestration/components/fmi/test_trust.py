"""Only what was built here from this project's sources runs in this process, whatever an archive says of itself."""

import os
import shutil
import sys
import zipfile
from pathlib import Path

import pytest

import quadcosim
from fmu_kit.archive import SOURCE_HASH_FILE, read_source_hash
from orchestration.components.building import builder
from orchestration.components.fmi import trust
from orchestration.components.fmi.foreign_calls import LostError, isolated_call
from orchestration.components.fmi.opening import open_here
from orchestration.components.fmi.read_description import read_model
from orchestration.components.fmi.surroundings import LIMITS, ROUNDING
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.processes.resource_limits import own_limits
from orchestration.simulation.workers.choice import choose_execution
from orchestration.simulation.workers.pool import Inputs
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.files import Files, files_of
from orchestration.systems.system.model import System
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.components.fmi.test_foreign_fmus import alone, ran

HASHES = pytest.mark.parametrize("forged", [False, True], ids=["no hash", "a forged hash"])


def test_a_copy_is_trusted_as_its_original_and_not_with_one_byte_altered(
    built: dict[str, Path], tmp_path: Path
) -> None:
    path = Path(shutil.copy(built["QuadrotorPlant"], tmp_path / "copy.fmu"))
    assert read_model(path).is_own
    content = bytearray(path.read_bytes())
    content[-1] ^= 1  # of the comment's length, after all entries
    path.write_bytes(content + b"!")
    assert read_source_hash(path) is not None
    assert not read_model(path).is_own


def test_an_fmu_that_only_carries_the_hash_of_these_sources_is_built_anew(
    built: dict[str, Path], tmp_path: Path
) -> None:
    path = Path(shutil.copy(built["QuadrotorPlant"], tmp_path))
    assert builder.out_of_date(["QuadrotorPlant"], tmp_path) == []
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = b"another content"
    assert builder.out_of_date(["QuadrotorPlant"], tmp_path) == ["QuadrotorPlant"]


def test_what_a_worker_may_run_beside_itself_is_told_by_its_coordinator(
    built: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "other.fmu"
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr(SOURCE_HASH_FILE, "0" * 64)
    files = Files(fmus={"own": built["QuadrotorPlant"], "other": other}, tables={})
    own = Inputs.of(files).own_fmus
    assert own == {files.hashes["own"]}
    monkeypatch.setattr(trust, "_accepted", set())
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "an empty cache"))
    assert trust.is_own(built["QuadrotorPlant"])
    monkeypatch.setattr(trust, "_folder", lambda: tmp_path / "of another machine")
    assert not trust.is_own(built["QuadrotorPlant"])
    trust.accept(own)
    assert trust.is_own(built["QuadrotorPlant"])


def writes_bytecode(fmu: Path) -> bool:
    with open_here(fmu, "it"):
        return not sys.dont_write_bytecode


@needs_compiler
def test_a_process_with_a_foreign_fmu_writes_no_bytecode(tmp_path: Path) -> None:
    assert not isolated_call([small(tmp_path)], writes_bytecode, small(tmp_path))


@needs_compiler
@HASHES
class TestForeign:
    """Each with and without a hash in its archive."""

    def test_what_it_computes_is_computed_in_another_process(self, forged: bool, tmp_path: Path) -> None:
        assert isolated_call([small(tmp_path, forged=forged)], os.getpid) != os.getpid()

    def test_its_exit_does_not_end_a_linearisation_in_silence(self, forged: bool, tmp_path: Path) -> None:
        ends = small(tmp_path / "ends", "EXITS_AT_START", forged=forged)
        with pytest.raises(LostError, match=r"^the process of the FMUs ended with exit code 0$"):
            quadcosim.linearise(loop_of(ends, small(tmp_path / "other")))

    def test_its_rounding_mode_is_restored_with_a_warning(self, forged: bool, tmp_path: Path) -> None:
        result = ran(alone(small(tmp_path, "ENDS=fesetround(FE_UPWARD)", forged=forged)))
        assert any(ROUNDING in warning for warning in result.warnings)

    def test_a_limit_that_it_lowers_is_set_again_with_a_warning(self, forged: bool, tmp_path: Path) -> None:
        before = own_limits()
        lowers = "ENDS=struct rlimit r; getrlimit(RLIMIT_FSIZE, &r); r.rlim_cur = 0; setrlimit(RLIMIT_FSIZE, &r)"
        result = ran(alone(small(tmp_path, lowers, forged=forged)))
        assert any(LIMITS in warning for warning in result.warnings)
        assert own_limits() == before

    def test_its_code_for_lanes_is_not_loaded_here(self, forged: bool, tmp_path: Path) -> None:
        path = small(tmp_path, forged=forged)
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr("sources/lanes.c", "#include <stdlib.h>\n[[gnu::constructor]] void f(void) { _Exit(0); }")
        system = alone(path)
        with pytest.raises(QuadcosimError, match=r"the process of the FMUs ended with exit code 0"):
            choose_execution("batch", False, lambda native: (system, files_of(system)))
        assert "expected in_process=True" in str(quadcosim.fly(system, {"stop_time": [0.1]}).reason)

    def test_its_abort_ends_no_simulation_that_is_stepped_from_python(self, forged: bool, tmp_path: Path) -> None:
        ends = small(tmp_path / "ends", "CRASHES", forged=forged)
        system = loop_of(ends, small(tmp_path / "other"))
        with quadcosim.Simulation(system) as simulation:
            simulation.reset()
            with pytest.raises(QuadcosimError, match=r"SIGABRT"):
                simulation.step([0.0])


def loop_of(one: Path, sampled: Path) -> System:
    """Two FMUs in a loop, the second one sampled."""
    return System(
        stop_time=0.1,
        components={
            "it": Component(fmu=str(one), step=0.01),
            "other": Component(fmu=str(sampled), sampling=Sampling(period=0.01)),
        },
        connections=(
            Connection(name="0", start=("it.y",), end=("other.u",)),
            Connection(name="1", start=("other.y",), end=("it.u",)),
        ),
    )
