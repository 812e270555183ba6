"""Every reader of a user's files, on files that are damaged or meant badly: one line, no hang, little memory."""

import signal
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import quadcosim
from orchestration.experiments.studies.study_file import load_study
from orchestration.quadrotor.scenarios.timing import preset_timing
from orchestration.quadrotor.scenarios.wiring import REFERENCE
from orchestration.simulation.requests.request import load_request
from orchestration.simulation.requests.ssp import writing
from orchestration.simulation.runs.pause import read_state
from orchestration.systems.signals.table_file import read_table
from quadcosim import Scenario, UsageError, fly_until, load_run, load_scenario, save_run
from tests.extent import tries

resource = pytest.importorskip("resource")  # and signals with a time, neither of which Windows has

SECONDS = 20
"""of a processor, after which an example counts as hanging; each takes milliseconds"""
MEGABYTES = 500
"""that all examples of a reader may add to the memory of the process"""

SCENARIO = (Path(__file__).with_name("fuzzed") / "scenario.toml").read_text(encoding="utf-8")
STUDY = (Path(__file__).with_name("fuzzed") / "study.toml").read_text(encoding="utf-8")
SYSTEM = (Path(__file__).with_name("fuzzed") / "system.toml").read_text(encoding="utf-8")
TIMING = (Path(__file__).with_name("fuzzed") / "timing.toml").read_text(encoding="utf-8")
TABLE = "\n".join(
    ",".join(map(str, row)) for row in (("time", *REFERENCE), *([t] + [0.5] * 15 for t in (0.0, 1.0, 2.0)))
)

FRAGMENTS = (
    b"\0", b"\xef\xbb\xbf", b"\xff\xfe", b"\\u0000", b"\r", b";", b'"', b"'''", b"#", b"=", b"\n[", b"{", b"-", b"e9",
    b"-1", b"nan", b"-inf", b"1e999", b"true", b'"text"', b"[1, true]", b"[]", b"{}", b"2020-01-01",
    b"9" * 30, b"9" * 400, b"9" * 5000, b"[" * 3000, b"{" * 3000, b'{"a":' * 3000, b"a." * 3000, b"a={" * 500,
    b"0x" + b"f" * 5000, b"x" * 140_000, b"\n" * 5000, b"1," * 5000,
)  # fmt: skip


Cut = tuple[float, int, bytes | None]
"""Where a piece is taken out, as a share of the file, how long it is, and what comes there; None: it twice."""

CUTS: st.SearchStrategy[list[Cut]] = st.lists(
    st.tuples(
        st.floats(0.0, 1.0),
        st.integers(0, 12) | st.integers(0, 10_000),
        st.sampled_from(FRAGMENTS) | st.binary(max_size=4) | st.none(),
    ),
    min_size=1,
    max_size=3,
)


def damaged(content: bytes, cuts: list[Cut]) -> bytes:
    for share, length, piece in cuts:
        start = int(share * len(content))
        end = start + length
        content = content[:start] + (content[start:end] * 2 if piece is None else piece) + content[end:]
    return content


@st.composite
def with_another_value(draw: st.DrawFn, text: str) -> bytes:
    """A TOML file one of whose values is something else, so that what reads the tables is reached."""
    lines = text.splitlines()
    number = draw(st.sampled_from([i for i, line in enumerate(lines) if "=" in line]))
    value = draw(st.sampled_from(FRAGMENTS) | st.sampled_from((b"0", b"2", b"0.5", b'["a"]', b"[[1]]", b'{ a = "b" }')))
    lines[number] = lines[number].partition("=")[0]
    return b"\n".join(line.encode() + (b"= " + value if i == number else b"") for i, line in enumerate(lines))


@contextmanager
def bounded() -> Iterator[None]:
    """A stop for what hangs."""

    def stop(number: int, frame: FrameType | None) -> None:
        raise AssertionError(f"still reading after {SECONDS} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def is_read_or_refused(read: Callable[[], object]) -> None:
    """A reader returns, or raises `UsageError` with one line."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with bounded():
        try:
            read()
        except UsageError as error:
            problem = str(error)
            if not problem.isprintable() or "expected" not in problem:
                raise AssertionError(problem) from error
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < MEGABYTES * 1024


fuzz = settings(
    max_examples=tries(150, sampled=15),
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@fuzz
@given(CUTS.map(lambda cuts: damaged(SCENARIO.encode(), cuts)) | with_another_value(SCENARIO))
@example(b"\xef\xbb\xbfstop_time = 1.0")
@example(b"[timing]\npreset = [1]")
def test_a_scenario(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "scenario.toml"
    path.write_bytes(content)
    is_read_or_refused(lambda: load_scenario(path).to_toml())


@fuzz
@given(CUTS.map(lambda cuts: damaged(STUDY.encode(), cuts)) | with_another_value(STUDY))
@example(STUDY.replace("[1, 2]", '["text"]').encode())
@example(STUDY.replace("[1, 2]", "[1.5]").encode())
@example(STUDY.replace("seed = 1", "seed = -1").encode())
def test_a_study(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "study.toml"
    path.write_bytes(content)
    is_read_or_refused(lambda: load_study(path).system(0, {}))


@fuzz
@given(CUTS.map(lambda cuts: damaged(SYSTEM.encode(), cuts)) | with_another_value(SYSTEM))
def test_a_system(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "system.toml"
    path.write_bytes(content)
    is_read_or_refused(lambda: load_request(path).to_toml())


@pytest.fixture(scope="module")
def ssp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Unpacked, so that it is not opened again for each example."""
    folder = tmp_path_factory.mktemp("ssp")
    written = writing.write(Scenario().with_changes(timing={"plant_interval": 0.01}), folder / "loop.ssp")
    with zipfile.ZipFile(written) as archive:
        archive.extractall(folder)
    return folder / "SystemStructure.ssd"


@settings(fuzz, max_examples=tries(100, sampled=10))
@given(CUTS.map(lambda cuts: damaged(TIMING.encode(), cuts)) | with_another_value(TIMING))
@example(TIMING.encode())
@example(b"components = 3")
def test_the_timing_of_an_ssp(tmp_path: Path, ssp: Path, content: bytes) -> None:
    path = tmp_path / "timing.toml"
    path.write_bytes(content)
    is_read_or_refused(lambda: load_request(ssp, path).to_toml())


@fuzz
@given(CUTS.map(lambda cuts: damaged(TABLE.encode(), cuts)))
@example(TABLE.replace(",", ";").encode())
def test_a_reference(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "reference.csv"
    path.write_bytes(content)
    is_read_or_refused(lambda: read_table(path, REFERENCE, 1.0))


@fuzz
@given(st.text())
def test_a_preset(name: str) -> None:
    is_read_or_refused(lambda: preset_timing(name))


RUN_FILES = ("events.parquet", "metrics.json", "provenance.json", "scenario.toml", "signals.parquet")


@pytest.fixture(scope="module")
def run_files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = save_run(quadcosim.run(Scenario(stop_time=0.02)), tmp_path_factory.mktemp("runs") / "run", figures=False)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@settings(fuzz, max_examples=tries(60, sampled=6))
@given(st.sampled_from(RUN_FILES), CUTS)
def test_a_directory_of_a_run(tmp_path: Path, run_files: dict[str, bytes], name: str, cuts: list[Cut]) -> None:
    for other, content in run_files.items():
        (tmp_path / other).write_bytes(content)
    (tmp_path / name).write_bytes(damaged(run_files[name], cuts))
    is_read_or_refused(lambda: load_run(tmp_path))


@pytest.fixture(scope="module")
def paused(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("paused") / "run"
    fly_until(Scenario(stop_time=0.04), 0.02, folder)
    return (folder / "paused.npz").read_bytes()


@fuzz
@given(CUTS)
def test_the_state_of_a_paused_run(tmp_path: Path, paused: bytes, cuts: list[Cut]) -> None:
    path = tmp_path / "paused.npz"
    path.write_bytes(damaged(paused, cuts))
    is_read_or_refused(lambda: read_state(path))
