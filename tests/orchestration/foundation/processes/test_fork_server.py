"""A forked process is what a new Python with its environment would be, without importing anything again."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from orchestration.foundation.processes import fork_server, subprocesses
from orchestration.foundation.processes.child import Child
from orchestration.foundation.processes.resource_limits import Limits
from tests.orchestration.foundation.processes.test_child import gone
from tests.patience import PATIENCE

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")
MODULE = "tests.orchestration.foundation.processes.forked_module"


def module(*arguments: object) -> subprocesses.Module:
    return subprocesses.Module.of(MODULE, *arguments)


def seen(*arguments: object, folder: Path | None = None, **variables: str) -> dict[str, Any]:
    with Child(module("look", *arguments), folder=folder, environment=subprocesses.environment(**variables)) as child:
        found: dict[str, Any] = child.receive()
        assert child.ending(PATIENCE).code == 0
    return found


def servers(name: str) -> list[int]:
    return [server.pid for key, server in fork_server.servers.items() if key[0] == name]


def test_a_forked_process_has_its_own_arguments_folder_environment_and_session(tmp_path: Path) -> None:
    other = seen(1, OF_ANOTHER="x")
    found = seen("two", tmp_path, folder=tmp_path, OF_ITS_OWN="y", TMPDIR=str(tmp_path))
    assert found["arguments"] == ("two", str(tmp_path))
    assert found["folder"] == found["path"] == found["temporary"] == str(tmp_path)
    assert (found["variable"], found["other variable"]) == ("y", None)
    assert found["session"] == found["process"] != other["process"]
    assert found["interrupt"]


def test_one_process_has_imported_the_module_for_all() -> None:
    first, second = seen(), seen()
    assert first["imported by"] == second["imported by"]
    assert first["imported by"] in servers(MODULE)
    assert first["process"] not in servers(MODULE)


def test_what_a_process_will_load_is_loaded_before_it_is_forked() -> None:
    assert not seen()["loaded"]
    with Child(subprocesses.Module(MODULE, ("look",), loads=("there_is_none", "colorsys"))) as child:
        assert child.receive()["loaded"]
    assert seen()["loaded"]


def test_a_variable_that_python_reads_when_it_starts_has_a_server_of_its_own() -> None:
    assert seen()["imported by"] != seen(PYTHONUTF8="1")["imported by"]


def test_no_file_of_another_process_is_open_there() -> None:
    with open(os.devnull) as _, Child(module("look")) as one:
        found = one.receive()
        again = seen()
    assert found["open"] == again["open"]
    # The standard streams, the two of `Parent`, and the folder that is listed.
    assert len(found["open"]) == 6


def test_the_system_shows_its_family_and_no_other() -> None:
    first, second = seen()["families"], seen()["families"]
    assert len(first) == len(second) == 1
    assert first != second
    assert first[0].startswith("QUADCOSIM_FAMILY=" + os.environ.get("QUADCOSIM_FAMILY", ""))


def test_how_it_ends_is_how_a_python_would() -> None:
    def ending(*arguments: object) -> tuple[int | None, str]:
        with Child(module(*arguments), limits=Limits()) as child:
            found = child.ending()
        return found.code, found.last_line

    assert ending("fail") == (1, "KeyError: 'what was wrong'")
    assert ending("exit", 3) == (3, "")
    assert ending("kill", int(signal.SIGTERM))[0] == -signal.SIGTERM
    assert ending("no such thing")[0] == 0


@pytest.mark.parametrize("thread", [[], ["thread"]])
def test_nothing_that_is_left_to_do_is_lost_at_its_end(thread: list[str], capfd: pytest.CaptureFixture[str]) -> None:
    with Child(module("end in parts", *thread), environment=subprocesses.environment(PYTHONUNBUFFERED="")) as child:
        assert child.ending(PATIENCE).code == 0
    assert {*capfd.readouterr().err.splitlines()} == {"of Python", "of C", "at exit", *(f"of a {x}" for x in thread)}


def test_its_errors_go_where_those_of_this_process_go_now(capfd: pytest.CaptureFixture[str]) -> None:
    for text in ("one", "two"):
        with Child(module("print", text)) as child:
            child.ending(PATIENCE)
        assert capfd.readouterr().err == f"{text}\n"


def test_a_module_that_cannot_be_imported_is_reported_by_the_process() -> None:
    with Child(
        subprocesses.Module.of("tests.orchestration.foundation.processes.there_is_none"), limits=Limits()
    ) as child:
        found = child.ending()
    assert (found.code, found.last_line.split(":")[0]) == (1, "ModuleNotFoundError")


def test_what_a_killed_server_has_forked_ends_and_it_is_replaced() -> None:
    waiting = subprocesses.Module.of("orchestration.components.fmi.foreign_process")
    first = Child(waiting)
    (server,) = servers(waiting.name)
    os.kill(server, signal.SIGKILL)
    assert gone(first.pid)
    assert first.ending(PATIENCE).code == -signal.SIGKILL
    with Child(waiting) as second:
        assert not gone_now(second.pid)
        assert servers(waiting.name) != [server]


def test_what_a_forked_process_leaves_in_a_session_of_its_own_ends_with_it() -> None:
    with Child(module("leave")) as child, Child(module("leave")) as other:
        left, left_by_other = child.receive(), other.receive()
        child.close()
        assert gone(left)
        assert not gone_now(left_by_other)
    assert gone(left_by_other)


def test_a_forked_process_ends_with_its_server_though_that_ended_before_it_looked() -> None:
    child = Child(module("look late"))
    for server in servers(MODULE):
        os.kill(server, signal.SIGKILL)
    assert gone(child.pid)
    child.close()


def test_a_stopped_server_does_not_keep_its_process_from_ending(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fork_server, "_PATIENCE", 0.1)
    server = fork_server.ForkServer(MODULE, subprocesses.environment())
    os.kill(server.pid, signal.SIGSTOP)
    server.close()
    assert gone(server.pid)


def test_a_stopped_server_keeps_no_process_from_starting(monkeypatch: pytest.MonkeyPatch) -> None:
    obeys = subprocesses.Module.of("orchestration.components.fmi.foreign_process")
    Child(obeys).close()
    stopped = servers(obeys.name)
    monkeypatch.setattr(fork_server, "_PATIENCE", 0.1)
    monkeypatch.setattr(fork_server, "_STARTS_WITHIN", 0.1)
    for server in stopped:
        os.kill(server, signal.SIGSTOP)
    with Child(obeys) as child:
        child.send((os.getpid, ()))
        assert child.receive() == (child.pid, None)
    assert all(map(gone, stopped))


@pytest.mark.parametrize("environment", [{"QUADCOSIM_FAMILY": "its own"}, {}], ids=["no folder", "no family"])
def test_what_cannot_start_is_no_process(environment: dict[str, str], tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError if environment else OSError):
        fork_server.forked(
            module("look"),
            environment=subprocesses.environment(**environment),
            folder=tmp_path / "none" if environment else None,
            piped=(True, True, True),
        )


def written(folder: Path, text: str) -> dict[str, str]:
    """The variables with which a module `written` of this text can be imported."""
    (folder / "written.py").write_text(text)
    return subprocesses.environment(PYTHONPATH=os.pathsep.join((subprocesses.ROOT, str(folder))))


def test_a_server_that_cannot_fork_remains(tmp_path: Path) -> None:
    cannot = "import os\ndef fork(): raise BlockingIOError(11, 'too many processes')\nos.fork = fork"
    environment = written(tmp_path, cannot) | {f"LONG_{i}": 100_000 * "x" for i in range(4)}
    with pytest.raises(BlockingIOError):
        Child(subprocesses.Module.of("written"), environment=environment)
    assert not gone_now(servers("written")[-1])


def test_a_module_that_ends_what_imports_it_ends_a_python_of_its_own(tmp_path: Path) -> None:
    environment = written(tmp_path, "raise SystemExit('not here')")
    with Child(subprocesses.Module.of("written"), environment=environment, limits=Limits()) as child:
        found = child.ending()
    assert (found.code, found.last_line) == (1, "not here")


@pytest.mark.skipif(sys.version_info < (3, 11), reason="Python has no safe path")
def test_its_folder_is_not_on_a_safe_path(tmp_path: Path) -> None:
    assert seen(folder=tmp_path, PYTHONSAFEPATH="1")["path"] != str(tmp_path)


def test_a_forked_process_starts_where_the_system_shows_no_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "read_text", lambda _: Path("/no/proc").stat())
    assert seen()["imported by"] in servers(MODULE)


FILES = """
import os, resource
from orchestration.foundation.processes.child import Child
from orchestration.foundation.processes.subprocesses import Module
def limit(files):
    resource.setrlimit(resource.RLIMIT_NOFILE, (files, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
def look():
    with Child(Module.of("tests.orchestration.foundation.processes.forked_module", "look")) as child:
        child.receive()
    return len(os.listdir("/proc/self/fd"))
"""
FILES_OF_MANY = 2000
MANY = f"limit({FILES_OF_MANY}); files = [os.dup(0) for _ in range(1100)]; look()"
FEW = """
before = look()
limit(before + 2)
try:
    look()
except OSError as error:
    print(error.strerror)
limit(before + 10)
print(look() - before)
"""


@pytest.mark.parametrize(("program", "printed"), [(MANY, []), (FEW, ["Too many open files", "0"])])
def test_many_files_may_be_open_and_few_allowed(program: str, printed: list[str]) -> None:
    import resource

    if program == MANY and 0 <= resource.getrlimit(resource.RLIMIT_NOFILE)[1] < FILES_OF_MANY:
        pytest.skip(f"the system allows a process fewer than {FILES_OF_MANY} files (ulimit -H -n)")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", FILES + program],
        env=subprocesses.environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout.splitlines(), done.stderr) == (printed, "")


def test_the_standard_streams_may_be_closed() -> None:
    closed = ["sh", "-c", 'exec "$0" -c "$1" <&- >&- 2>&-', sys.executable, f"{FILES}\nos._exit(look() and 7)"]
    assert subprocess.run(closed, env=subprocesses.environment(), check=False).returncode == 7


def gone_now(pid: int) -> bool:
    return not Path(f"/proc/{pid}").exists()


PROGRAM = """
import os, sys
from orchestration.foundation.processes.child import Child
from orchestration.foundation.processes.fork_server import servers
from orchestration.foundation.processes.subprocesses import Module
child = Child(Module.of("tests.orchestration.foundation.processes.forked_module", "look"))
server = child.receive()["imported by"]
waiting = Child(Module.of("orchestration.components.fmi.foreign_process"))
if sys.argv[1] == "forks" and os.fork() == 0:
    print(servers == {}, flush=True)  # it would keep them from ending
    other = Child(Module.of("tests.orchestration.foundation.processes.forked_module", "look")).receive()["imported by"]
    print(other != server, flush=True)
    os._exit(0)
if sys.argv[1] == "forks":
    os.wait()
print(server, waiting.pid, flush=True)
if sys.argv[1] == "killed":
    os.kill(os.getpid(), 9)
"""


@pytest.mark.parametrize("how", ["ends", "killed", "forks"])
def test_servers_and_what_they_forked_end_with_the_process(how: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, how],
        env=subprocesses.environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (-signal.SIGKILL if how == "killed" else 0, "")
    *before, pids = done.stdout.splitlines()
    assert before == (["True", "True"] if how == "forks" else [])
    assert all(gone(int(pid)) for pid in pids.split())
