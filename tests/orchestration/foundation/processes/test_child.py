"""A child process exchanges messages, and is ended at its limits with all its descendants."""

import dataclasses
import os
import pickle
import subprocess
import sys
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from orchestration.foundation.processes.child import Child, Died, Ending
from orchestration.foundation.processes.resource_limits import UNLIMITED, Limits
from tests.patience import PATIENCE

linux_only = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="no /proc")

TALKS = "from orchestration.foundation.processes.channel import Parent; parent = Parent()"
FORK = """
import os, sys, time
from tests.patience import PATIENCE
if os.fork() == 0:
    os.setsid()
    with open(sys.argv[1], "w") as file:
        file.write(str(os.getpid()))
    time.sleep(600)
while not (os.path.exists(sys.argv[1]) and open(sys.argv[1]).read()):
    time.sleep(0.01)
{then}
"""


def python(program: str, *arguments: object, **limits: float) -> Ending:
    command = [sys.executable, "-c", f"{TALKS}\n{program}", *map(str, arguments)]
    with Child(command, limits=Limits(**limits)) as child:
        return child.ending()


def gone(pid: int) -> bool:
    """Whether a process has ended, perhaps only after a moment."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            return True
        if state == "Z":
            return True
        time.sleep(0.02)
    return False


def test_a_process_that_keeps_its_limits_ends_itself() -> None:
    ending = python("import sys; print('first'); print('last', file=sys.stderr); sys.exit(3)")
    assert (ending.code, ending.reached, ending.out_of_time) == (3, None, False)
    assert ending.last_line in ("first", "last")


@pytest.mark.parametrize(
    ("program", "limits", "reached"),
    [
        ("import time; time.sleep(60)", {"time": 1.0}, "it takes longer than the limit of 1 s"),
        (
            "while True: print('x' * 1000)", {"output": 0.5},
            "it writes more than the limit of 0.5 MB to its standard output and error",
        ),
        (  # ends before the first check
            "print('x' * 600_000)", {"output": 0.5},
            "it writes more than the limit of 0.5 MB to its standard output and error",
        ),
        pytest.param(
            "a = bytearray(b'x' * 300_000_000)\nwhile True: pass", {"memory": 200.0},
            "it takes more memory than the limit of 200 MB", marks=linux_only,
        ),
    ],
)  # fmt: skip
def test_a_process_is_stopped_at_its_limits(program: str, limits: dict[str, float], reached: str) -> None:
    ending = python(program, **limits)
    assert (ending.code, ending.reached, ending.out_of_time) == (None, reached, "time" in limits)


@linux_only
@pytest.mark.parametrize(("then", "code"), [("sys.exit(0)", 0), ("while True: print('x' * 1000)", None)])
def test_what_a_process_has_started_does_not_outlive_it(then: str, code: int | None, tmp_path: Path) -> None:
    file = tmp_path / "pid"
    assert python(FORK.format(then=then), file, output=0.5).code == code
    assert gone(int(file.read_text()))


@linux_only
def test_the_memory_of_what_a_process_has_started_counts(tmp_path: Path) -> None:
    grow = "a = b'x' * 300_000_000\n"
    program = FORK.format(then="time.sleep(600)").replace(
        "    time.sleep(600)\nwhile", f"    {grow}    time.sleep(600)\nwhile"
    )
    ending = python(program, tmp_path / "pid", memory=200.0)
    assert ending.reached == "it takes more memory than the limit of 200 MB"


def test_no_file_may_grow_beyond_its_limit(tmp_path: Path) -> None:
    program = "import sys; from orchestration.foundation.processes.resource_limits import restrict; restrict(1.0)\n" + (
        "with open(sys.argv[1], 'wb') as file: file.write(bytes(2_000_000))"
    )
    assert "File too large" in python(program, tmp_path / "file").last_line


TELLS_ITS_LIMIT = "import resource; parent.receive(); print(*resource.getrlimit(resource.RLIMIT_CPU))"


@linux_only
def test_the_system_limits_a_process_whose_parent_is_killed() -> None:
    seconds = 600 * (os.cpu_count() or 1) + 1
    with Child([sys.executable, "-c", f"{TALKS}\n{TELLS_ITS_LIMIT}"], limits=Limits(time=600.0)) as child:
        child.send("limited")
        assert child.ending().last_line == f"{seconds} {seconds + 1}"


UNDER_A_LIMIT = """
import resource, sys
from orchestration.foundation.processes.child import Child
from orchestration.foundation.processes.resource_limits import Limits
resource.setrlimit(resource.RLIMIT_CPU, ({soft}, {hard}))
with Child([sys.executable, "-c", sys.argv[1]], limits=Limits()) as child:
    child.send("limited")
    ending = child.ending()
print(ending.code, ending.reached, ending.last_line, sep="|")
"""


def under_a_limit(program: str, *, soft: int, hard: int) -> list[str]:
    """Code, limit reached and last line of a program confined by a process with a limit of processor time."""
    command = [sys.executable, "-c", UNDER_A_LIMIT.format(soft=soft, hard=hard), f"{TALKS}\n{program}"]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout.strip().split("|")


@linux_only
@pytest.mark.parametrize(("soft", "hard", "left"), [(40, 40, "39 40"), (30, 50, "30 50")])
def test_an_existing_limit_of_processor_time_holds_for_a_confined_process(soft: int, hard: int, left: str) -> None:
    assert under_a_limit(TELLS_ITS_LIMIT, soft=soft, hard=hard) == ["0", "None", left]


@linux_only
def test_a_process_ended_by_an_existing_limit_of_processor_time_is_reported_so() -> None:
    reached = "it uses more processor time than the system allows (ulimit -t)"
    assert under_a_limit("while True: pass", soft=2, hard=2) == ["None", reached, ""]


BUSY = """
import os, time
os.sched_setaffinity(0, {{{core}}})
parent.send("ready")
parent.receive()
end = time.process_time() + 0.12
while time.process_time() < end:
    pass
parent.send("done")
"""


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the system does not report waiting times")
def test_time_spent_waiting_for_a_processor_does_not_count() -> None:
    core = min(os.sched_getaffinity(0))
    spin = f"import os\nos.sched_setaffinity(0, {{{core}}})\nwhile True: pass"
    with ExitStack() as stack:
        for _ in range(4):
            other = subprocess.Popen([sys.executable, "-c", spin], start_new_session=True)
            stack.callback(other.wait)
            stack.callback(other.kill)
        one = stack.enter_context(Child([sys.executable, "-c", f"{TALKS}\n{BUSY.format(core=core)}"]))
        assert one.receive() == "ready"
        one.allow(0.3)
        started = time.monotonic()
        one.send("begin")
        assert one.receive() == "done"
        took = time.monotonic() - started
    assert took > 0.3, "expected it to have waited for longer than its limit"


# -- messages ---------------------------------------------------------------------------------------------

ECHO = "for message in parent: parent.send(message)"


@pytest.fixture
def child() -> Iterator[Callable[..., Child]]:
    """Starts a program that communicates."""
    with ExitStack() as stack:
        yield lambda program, **limits: stack.enter_context(
            Child([sys.executable, "-c", f"{TALKS}\n{program}"], limits=dataclasses.replace(UNLIMITED, **limits))
        )


def test_messages_arrive_whatever_is_printed_and_read_meanwhile(child: Callable[..., Child]) -> None:
    one = child(f"import sys; print('printed', flush=True); sys.stdin.read()\n{ECHO}")
    for message in ("a word", {"an": ["object"]}, b"x" * 1_000_000):
        one.send(message)
        assert one.receive() == message


def test_a_child_whose_input_is_closed_ends_itself_if_there_is_patience(
    child: Callable[..., Child], tmp_path: Path
) -> None:
    one = child(f"{ECHO}\nopen({str(tmp_path / 'ended')!r}, 'w')")
    one.send(0)
    assert one.receive() == 0
    one.close(PATIENCE)
    assert (tmp_path / "ended").exists()


@pytest.mark.parametrize(
    ("program", "expected"),
    [
        ("import sys; sys.exit(3)", "ended with exit code 3"),
        ("import os; os.kill(os.getpid(), 11)", "ended by SIGSEGV"),
        pytest.param("import os; os.kill(os.getpid(), 40)", "ended by signal 40", marks=linux_only),
        ("parent.send(Unknown())", "ended with exit code 1"),
        ("parent._answers.write(bytes([200, 0, 0, 0, 0, 0, 0, 0, 1]))", "ended with exit code 0"),
        ("import os, time; os.close(parent._answers.fileno()); time.sleep(600)", "does not answer"),
    ],
)
def test_the_end_of_a_child_is_reported_to_a_waiting_receiver(
    program: str, expected: str, child: Callable[..., Child], monkeypatch: pytest.MonkeyPatch
) -> None:
    if expected == "does not answer":
        monkeypatch.setattr("orchestration.foundation.processes.child._PATIENCE", 0.1)
    one = child(f"class Unknown: pass\n{program}")
    with pytest.raises(Died) as death:
        one.receive()
    assert str(death.value) == expected
    assert gone(one.pid)


PICKLE = """
class Evil:
    def __reduce__(self): return os.mkdir, (sys.argv[1],)
frame = pickle.dumps(Evil())
write(struct.pack("<Q", len(frame)) + frame)
"""
NO_MESSAGE = "it sends what is no message of quadcosim"


@pytest.mark.parametrize(
    ("program", "reached"),
    [
        (PICKLE, NO_MESSAGE),
        ("write(b'no frame, but long enough for one')", "it sends more than 2000 MB at once"),
        ("write(struct.pack('<Q', 2**62))", "it sends more than 2000 MB at once"),
        ("write(struct.pack('<Q', 100) + bytes(7))", NO_MESSAGE),
        ("write(bytes(5))", NO_MESSAGE),
        ("write(struct.pack('<Q', 5) + b'\\xdd\\xff\\xff\\xff\\xff')", NO_MESSAGE),
        ("parent.send('a text')", NO_MESSAGE),
    ],
)
def test_a_child_that_writes_what_is_no_message_into_all_that_it_has_open_is_ended(
    program: str, reached: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("orchestration.foundation.processes.channel.STALL", 0.1)
    write = """
import os, pickle, stat, struct, sys, time
def write(content):
    for descriptor in range(64):
        try:
            os.write(descriptor, content)
        except OSError:
            pass
"""
    command = [sys.executable, "-c", f"{TALKS}\n{write}\n{program}\ntime.sleep(600)", str(tmp_path / "made")]
    with Child(command) as one:
        with pytest.raises(Died) as death:
            one.receive(dict[str, float])
        assert death.value.ending.reached == reached
        assert gone(one.pid)
    assert not (tmp_path / "made").exists()


FORGES = """
import sys
from orchestration.foundation.processes.channel import Parent
parent = Parent()
parent.receive()
if sys.argv[1] == "forged":
    parent._secret = b"?" * len(parent._secret)
parent.send("done")
parent.receive()
"""


def test_a_message_without_the_secret_of_the_question_is_none() -> None:
    with Child([sys.executable, "-c", FORGES, "true"]) as one:
        one.send("a question")
        assert one.receive(str) == "done"
    with Child([sys.executable, "-c", FORGES, "forged"]) as one:
        one.send("a question")
        with pytest.raises(Died, match=NO_MESSAGE):
            one.receive(str)


def test_sending_to_a_child_closed_by_another_thread_reports_its_death(
    child: Callable[..., Child],
) -> None:
    one = child(ECHO)
    one.close()
    with pytest.raises(Died, match=r"^ended by SIGKILL$"):
        one.send(0)


def test_a_message_that_cannot_be_pickled_does_not_end_the_child(child: Callable[..., Child]) -> None:
    one = child(ECHO)
    with pytest.raises((pickle.PicklingError, AttributeError, TypeError)):
        one.send(lambda: None)
    one.send(0)
    assert one.receive() == 0


def test_a_child_is_ended_before_a_message_longer_than_its_limit_is_read(child: Callable[..., Child]) -> None:
    one = child("parent.send(bytes(2000)); parent.receive()", message=0.003)
    assert one.receive() == bytes(2000)
    one = child("parent.send(bytes(2000)); parent.receive()", message=0.001)
    with pytest.raises(Died, match=r"^was stopped: it sends more than 0.001 MB at once$"):
        one.receive()
    assert gone(one.pid)


def test_a_limited_child_that_is_garbage_collected_ends() -> None:
    one = Child([sys.executable, "-c", f"{TALKS}\n{ECHO}"], limits=Limits())
    pid, known = one.pid, weakref.ref(one)
    del one
    assert known() is None
    assert gone(pid)


def test_an_allowance_of_time_counts_from_when_it_is_given(child: Callable[..., Child]) -> None:
    one = child("import time\nfor seconds in parent: time.sleep(seconds); parent.send(seconds)", memory=1e6)
    one.send(1.5)
    assert one.receive() == 1.5
    one.allow(1.0)
    one.send(0.0)
    assert one.receive() == 0.0
    one.send(600.0)
    with pytest.raises(Died) as death:
        one.receive()
    assert death.value.ending.reached == "it takes more than the time limit of 1 s"


NESTED = """
import sys
from orchestration.foundation.processes.child import Child
from orchestration.foundation.processes.resource_limits import Limits
parent.receive()
sleep = [sys.executable, "-c", "import time; time.sleep(3.0)"]
with Child(sleep, limits=Limits(time=60.0), communicates=False) as inner:
    inner.ending()
parent.send("done")
"""


@linux_only
def test_the_time_of_a_process_with_its_own_limit_does_not_count_for_the_one_waiting(
    child: Callable[..., Child],
) -> None:
    one = child(NESTED)
    one.allow(2.0)
    one.send("begin")
    assert one.receive() == "done"


ORPHAN = f"""
import os, sys
from orchestration.foundation.processes.child import Child
program = {TALKS!r} + "\\nimport os, time; parent.send(os.getpid()); time.sleep(600)"
print(Child([sys.executable, "-c", program]).receive(), flush=True)
os.kill(os.getpid(), 9)
"""


@linux_only
def test_a_child_ends_with_its_parent_whatever_it_is_doing() -> None:
    done = subprocess.run([sys.executable, "-c", ORPHAN], capture_output=True, text=True, check=False)
    assert gone(int(done.stdout))
