"""A run with a third-party FMU has a separate process: however that ends, the run raises an error with its rows."""

import itertools
import os
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.foundation.processes import subprocesses
from orchestration.simulation.runs import run_in_process
from orchestration.simulation.runs.outcome import RunInterrupted, RunLost
from orchestration.simulation.runs.pause import fly_until, resume
from orchestration.simulation.runs.run_directory import load_run
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.component import Component
from orchestration.systems.system.connection import Connection, Source
from orchestration.systems.system.model import System
from tests.commands import Main
from tests.orchestration.components.fmi.small import needs_compiler, small

pytestmark = [needs_compiler, pytest.mark.skipif(sys.platform != "linux", reason="signals and /proc of Linux")]

SYSTEM = """\
stop_time = 0.1
[components.it]
fmu = "small.fmu"
step = 0.01
[sources.one]
constant = 1.0
to = ["it.u"]
"""


def alone(path: Path, **fields: Any) -> System:
    """The FMU with the input 1."""
    return System(
        stop_time=0.1,
        components={"it": Component(fmu=str(path), step=0.01)},
        sources={"one": Source(constant=1.0, to=("it.u",))},
        **fields,
    )


def beside(first: Path, second: Path) -> System:
    """One FMU, and behind it another one."""
    return System(
        stop_time=0.1,
        components={name: Component(fmu=str(path), step=0.01) for name, path in (("a", first), ("b", second))},
        connections=(Connection(name="0", start=("a.y",), end=("b.u",)),),
        sources={"one": Source(constant=1.0, to=("a.u",))},
    )


@pytest.fixture
def lost(tmp_path: Path) -> Callable[..., RunLost]:
    """What a run raises with an FMU that does something from 0.045 s on."""

    def ran(does: str, **how: Any) -> RunLost:
        with pytest.raises(RunLost) as raised:
            run(alone(small(tmp_path, f"ENDS={does}")), **how)
        return raised.value

    return ran


@pytest.mark.parametrize(
    ("does", "text"),
    [
        ("exit(0)", "ended with exit code 0"),
        ("abort()", "ended by SIGABRT"),
        ("raise(SIGFPE)", "ended by SIGFPE"),
        ("raise(SIGKILL)", "ended by SIGKILL"),
    ],
)
def test_however_an_fmu_ends_the_process_the_run_says_so_and_keeps_every_row(
    does: str, text: str, lost: Callable[..., RunLost], tmp_path: Path
) -> None:
    error = lost(does)
    assert str(error) == f"the process of the run {text}, in a call of it (Small), after t = 0.05 s of 0.1 s"
    assert error.result is not None
    whole = run(alone(small(tmp_path / "sound")), in_process=True)
    assert error.result.columns == whole.columns
    assert np.array_equal(error.result.rows, whole.rows[:6])
    assert error.result.interrupted_at == 0.05


def test_events_that_were_not_handed_over_are_kept_too(tmp_path: Path) -> None:
    system = beside(small(tmp_path / "sound"), small(tmp_path / "ends", "ENDS=exit(0)"))
    whole = run(beside(small(tmp_path / "sound"), small(tmp_path / "sound")), in_process=True)
    with pytest.raises(RunLost, match=r"in a call of b \(Small\)") as raised:
        run(system)
    kept = raised.value.result
    assert kept is not None
    assert kept.events == tuple(event for event in whole.events if event.time <= 50_000_000)


def test_an_fmu_that_ends_the_process_before_the_first_row_is_named(tmp_path: Path) -> None:
    with pytest.raises(RunLost) as raised:
        run(alone(small(tmp_path, "EXITS_AT_START")))
    assert str(raised.value) == "the process of the run ended with exit code 0, initialising it (Small)"
    assert raised.value.result is None


def test_the_command_says_it_in_one_line_and_keeps_the_rows_beside_what_is_there(tmp_path: Path, main: Main) -> None:
    (tmp_path / "system.toml").write_text(SYSTEM)
    crash = "the process of the run ended with exit code 0, in a call of it (Small), after t = 0.05 s of 0.1 s"
    error = "it (Small): fmi2DoStep: it: level 7 is 50% of it, at t = 0.01 s"
    for name, does, text, rows in (("out", "ENDS=exit(0)", crash, 6), ("out.1", "REFUSES", error, 1)):
        small(tmp_path, does)
        done = main("run", tmp_path / "system.toml", "--out", tmp_path / "out", code=1)
        assert done.stderr == f"quadcosim: {text}; what was recorded is in {tmp_path / name}\n"
        assert done.stdout == ""
        assert len(load_run(tmp_path / name).rows) == rows


def test_without_a_process_of_its_own_the_fmu_is_in_this_one(tmp_path: Path) -> None:
    path = small(tmp_path, "PRINTS_PROCESS")
    apart, here = run(alone(path)), run(alone(path), in_process=True)
    assert apart.signals["it.count"][-1] != os.getpid() == here.signals["it.count"][-1]


def test_a_run_apart_is_the_run_here_to_the_bit(tmp_path: Path) -> None:
    system = beside(small(tmp_path), small(tmp_path))
    shares: list[float] = []
    apart, here = run(system, progress=shares.append), run(system, in_process=True)
    assert np.array_equal(apart.rows, here.rows)
    assert apart.events == here.events
    assert (apart.metrics, apart.described, apart.units) == (here.metrics, here.described, here.units)
    assert apart.provenance["fmus"] == here.provenance["fmus"]
    assert shares[-1] == 1.0


def test_a_warning_of_the_fmu_comes_back(tmp_path: Path) -> None:
    assert run(alone(small(tmp_path, "WARNS"))).warnings == ("it: it: level 7 is 50% of it",)


@pytest.mark.parametrize(
    ("does", "text", "rows"),
    [
        ("REFUSES", "b: level 7 is 50% of it, at t = 0.01 s", 1),
        ("ENDS=return 3", "returned fmi2Error, without a message, at t = 0.06 s", 6),
        ("ENDS=return 5", "returned fmi2Pending, without a message, at t = 0.06 s", 6),
    ],
)
def test_an_error_of_the_fmu_comes_back_as_it_is_with_every_row(
    does: str, text: str, rows: int, tmp_path: Path
) -> None:
    sound = small(tmp_path / "sound")
    whole = run(beside(sound, sound), in_process=True)
    system = beside(sound, small(tmp_path, does))
    engines: tuple[Any, Any] = ("compiled", "python")
    for engine, in_process in itertools.product(engines, (False, True)):
        with pytest.raises(SimulatorError) as raised:
            run(system, engine=engine, in_process=in_process)
        assert str(raised.value) == f"b (Small): fmi2DoStep: {text}"
        kept = raised.value.result
        assert np.array_equal(kept.rows, whole.rows[:rows])
        assert kept.events == tuple(event for event in whole.events if event.time <= kept.interrupted_at * 1e9)
        assert (kept.interrupted_at, kept.warnings) == (kept.rows[-1, 0], (str(raised.value),))


def test_a_process_that_ends_after_the_run_costs_no_result(tmp_path: Path) -> None:
    result = run(alone(small(tmp_path, "CRASHES_WHEN_FREED")))
    assert len(result.rows) == 11
    assert result.warnings == ("after the run, its process ended by SIGABRT",)


@pytest.mark.parametrize("waits", ["for (;;)", "for (;;) pause()", "for (;;) usleep(1000)"])
def test_an_fmu_that_does_not_return_is_ended_at_the_time_limit(waits: str, lost: Callable[..., RunLost]) -> None:
    error = lost(waits, time_limit=0.5)
    why = "was ended: it takes more than the time limit of 0.5 s"
    assert str(error) == f"the process of the run {why}, in a call of it (Small), after t = 0.05 s of 0.1 s"
    assert error.result is not None
    assert len(error.result.rows) == 6


def test_an_fmu_that_does_not_return_after_ctrl_c_is_ended_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_in_process, "PATIENCE_OF_CALL", 0.2)
    path = small(tmp_path, f"ENDS=kill({os.getpid()}, SIGINT); for (;;) pause()")
    with pytest.raises(RunInterrupted) as raised:
        run(alone(path))
    where = "in a call of it (Small), after t = 0.05 s of 0.1 s"
    why = f"the process of the run did not end within 0.2 s of Ctrl-C, {where}"
    assert str(raised.value) == f"at t = 0.05 s of 0.1 s: {why}"
    assert len(raised.value.result.rows) == 6


def test_an_fmu_that_takes_too_much_memory_is_ended(lost: Callable[..., RunLost]) -> None:
    grows = "for (;;) memset(malloc(1000000), 1, 1000000)"
    assert "was ended: it takes more memory than the limit of 600 MB, in a call of it" in str(
        lost(grows, memory_limit=600.0)
    )


HABITS = ("fesetround(FE_UPWARD)", "fesetround(FE_TOWARDZERO)", '__asm__("ldmxcsr %0" : : "m"((unsigned){0x9fc0}))')


def pairs(first: Sequence[Path], second: Path) -> System:
    """Behind each of these FMUs another one."""
    numbers = range(len(first))
    fmus = {f"a{i}": path for i, path in enumerate(first)} | {f"b{i}": second for i in numbers}
    return System(
        stop_time=0.1,
        components={name: Component(fmu=str(path), step=0.01) for name, path in fmus.items()},
        connections=tuple(Connection(name=f"{i}", start=(f"a{i}.y",), end=(f"b{i}.u",)) for i in numbers),
        sources={"one": Source(constant=1.0, to=tuple(f"a{i}.u" for i in numbers))},
    )


@pytest.mark.parametrize("engine", ["compiled", "python"])
def test_an_fmu_that_rounds_otherwise_is_named_and_moves_no_other(engine: Any, tmp_path: Path) -> None:
    sound = small(tmp_path / "sound", "THIRDS")
    others = [small(tmp_path / f"{i}", "THIRDS", f"ENDS={habit}") for i, habit in enumerate(HABITS)]
    expected = run(pairs([sound] * len(others), sound), in_process=True, engine=engine)
    for in_process in (False, True):
        result = run(pairs(others, sound), engine=engine, in_process=in_process)
        text = "the FMU has changed the floating-point mode of the whole process, which was restored"
        assert result.warnings == tuple(f"a{i} (Small): {text}" for i in range(len(HABITS)))
        for i in range(len(HABITS)):
            assert result.signals[f"b{i}.y"].tobytes() == expected.signals[f"b{i}.y"].tobytes()


def test_an_fmu_that_changes_the_folder_is_named_and_the_folder_put_back(tmp_path: Path) -> None:
    sound, other = small(tmp_path / "sound"), small(tmp_path / "moves", 'ENDS=chdir("/")')
    before = os.getcwd()
    result = run(alone(other), in_process=True)
    assert os.getcwd() == before
    text = "the FMU has changed the current folder of the whole process, which was restored"
    assert result.warnings == (f"it (Small): {text}",)
    assert run(beside(sound, other)).warnings == (f"one of a (Small), b (Small): {text}",)


def test_an_archive_that_is_made_to_fill_the_disk_is_not_unpacked(tmp_path: Path, main: Main) -> None:
    path = small(tmp_path)
    (tmp_path / "system.toml").write_text(SYSTEM)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("resources/zeros", bytes(1_000_000))
        archive.getinfo("resources/zeros").file_size = 1_100_000_000  # as a directory says it of as many zeros
    done = main("run", tmp_path / "system.toml", code=2)
    assert "small.fmu: unpacks to 1100 MB, " in done.stderr
    assert done.stderr.endswith(" times its size: expected at most 1000 MB, or 20 times its size\n")


def test_ctrl_c_ends_the_run_at_an_instant_and_keeps_its_rows(tmp_path: Path) -> None:
    small(tmp_path, "SLOW")
    (tmp_path / "system.toml").write_text(SYSTEM.replace("0.1", "1000.0"))
    process = subprocess.Popen(
        subprocesses.command("quadcosim", "run", tmp_path / "system.toml", "--out", tmp_path / "out", "-v"),
        env=subprocesses.environment(), stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert process.stderr is not None
    while not list(tmp_path.glob(".quadcosim-*.new/partial/out/signals.parquet")):  # the process of the run has begun
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    assert "what was recorded is in" in process.stderr.read()
    assert process.wait() == 130
    process.stderr.close()
    kept = load_run(tmp_path / "out")
    assert kept.interrupted_at == kept.rows[-1, 0] < 1000.0


def test_a_run_is_paused_and_resumed_in_processes_of_their_own(tmp_path: Path) -> None:
    system = beside(small(tmp_path), small(tmp_path))
    whole = run(system, in_process=True)
    assert fly_until(system, 0.05, tmp_path / "paused", figures=False) is None
    result = resume(tmp_path / "paused")
    assert np.array_equal(result.rows, whole.rows)
    assert result.events == whole.events


def test_the_process_of_a_run_is_what_is_limited(tmp_path: Path, main: Main) -> None:
    with pytest.raises(UsageError, match="time_limit: expected without in_process"):
        run(alone(small(tmp_path)), in_process=True, time_limit=1.0)
    done = main("run", "--time-limit", "0", code=2)
    assert done.stderr == "quadcosim: --time-limit 0: expected a positive number of seconds\n"
