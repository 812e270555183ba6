"""Computers and networks in files: read, written, changed by path, rejected by name, compared."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from orchestration.experiments.studies.run_key import run_key
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.schedule.schedule_cache import schedule_key
from orchestration.systems.system.component import SamplingOnArrival, TaskSampling
from orchestration.systems.system.computers import Message, Network
from orchestration.systems.system.description import describe_clock
from orchestration.systems.system.file import is_system, load_system
from orchestration.systems.system.files import Files
from orchestration.systems.system.frames import frame_nanoseconds
from orchestration.systems.system.paths import changed, value_at
from orchestration.systems.system.placement import SHARED, punctual

FILE = Path(__file__).with_name("test_computers.toml").read_text(encoding="utf-8")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "trace.csv").write_text("time\n0.001\n0.002\n", encoding="utf-8")
    path = tmp_path / "system.toml"
    path.write_text(FILE, encoding="utf-8")
    return path


def test_a_written_system_is_read_as_the_same(file, tmp_path):
    system = load_system(file)
    again = tmp_path / "again.toml"
    again.write_text(system.to_toml(), encoding="utf-8")
    assert load_system(again) == system
    assert isinstance(system.components["controller"].sampling, TaskSampling)
    assert isinstance(system.components["filter"].sampling, SamplingOnArrival)
    assert system.components["controller"].sampling.period == pytest.approx(0.02 * 1.001)


@pytest.mark.parametrize(
    ("released", "when"),
    [('on = "filtered"', "on filtered"), ("period = 0.02\noffset = 0.004", "every 20 ms, from 4 ms")],
)
def test_the_clock_of_a_component_that_is_a_task_says_when_it_is_released(file, released, when):
    file.write_text(FILE.replace('on = "filtered"', released), encoding="utf-8")
    expected = f"sampled controller by task control of node {when}, filter on angle"
    assert describe_clock(load_system(file)) == expected


def test_computers_and_networks_alone_are_a_system(tmp_path):
    path = tmp_path / "alone.toml"
    path.write_text("stop_time = 1.0\n[computers.one.tasks.load]\nperiod = 0.1\n", encoding="utf-8")
    assert [*load_system(path).computers["one"].tasks] == ["load"]
    assert is_system({"networks": {}})


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("computers.node.scheduling", "fixed-priority"), ("computers.node.switch", 2e-6),
        ("computers.node.tasks.telemetry.execution", 0.002), ("computers.node.tasks.telemetry.priority", 3.0),
        ("computers.node.tasks.radio.arrivals.poisson", 7.0), ("networks.bus.bit_rate", 2e6),
        ("networks.bus.messages.load.from", "c"), ("networks.bus.messages.angle.bytes", 16.0),
    ],
)  # fmt: skip
def test_every_key_has_a_path(file, path, value):
    system = load_system(file)
    assert value_at(system, path) != value
    new = changed(system, {path: value})
    assert value_at(new, path) == value
    assert schedule_key(new) != schedule_key(system)
    hashes = {name: name for name in ("plant.fmu", "controller.fmu", "filter.fmu", "trace.csv")}
    files = Files(fmus={}, tables={})
    object.__setattr__(files, "hashes", {str(file.parent / name): name for name in hashes})
    object.__setattr__(files, "start_values", {str(file.parent / name): {} for name in hashes})
    assert run_key(new, files) != run_key(system, files)
    assert run_key(changed(new, {path: value_at(system, path)}), files) == run_key(system, files)


def test_the_time_of_a_task_is_a_key_of_its_computer(file):
    """Of one that has a component: its sampling is no table of the file."""
    system = load_system(file)
    for key, meant in (("sampling.jitter", "jitter"), ("step", " and one of component, period, offset, jitter, arri")):
        with pytest.raises(UsageError) as error:
            changed(system, {f"components.controller.{key}": 0.01})
        told = (
            f"components.controller.{key}: controller is a task, which its computer times: expected {CONTROL}.{meant}"
        )
        assert str(error.value).startswith(told)


def test_a_trace_that_is_written_anew_has_another_schedule(file):
    system = load_system(file)
    before = schedule_key(system)
    (file.parent / "trace.csv").write_text("time\n0.001\n0.003\n0.004\n", encoding="utf-8")
    assert schedule_key(system) != before


def test_a_system_is_random_where_anything_is_drawn(file):
    system = load_system(file)
    calm = replace(system, **punctual(system))
    assert system.depends_on_seed
    assert calm.depends_on_seed  # arrivals are random
    assert calm.computers["node"].tasks["control"].execution == 0.001
    by_chance = {"tasks": "radio", "messages": "load"}
    without: dict[str, Any] = {
        table: {
            name: replace(one, **{part: {key: x for key, x in getattr(one, part).items() if key != by_chance[part]}})
            for name, one in getattr(calm, table).items()
        }
        for table, (part, _) in SHARED.items()
    }
    calm = replace(calm, **without)
    assert not calm.depends_on_seed
    assert changed(calm, {"networks.bus.error": 0.1}).depends_on_seed


CONTROL, ANGLE = "computers.node.tasks.control", "networks.bus.messages.angle"
ON_ARRIVAL = 'sampling = { on = "angle" }'


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('component = "controller"', 'component = "pilot"', f"{CONTROL}.component = pilot: expected one of"),
        ('on = "filtered"', 'on = "wire"', f"{CONTROL}.on = wire: expected one of the connections"),
        ('on = "filtered"', "period = 0.01\non = 'filtered'", f"{CONTROL}.period = period and on: expected"),
        ("deadline = 0.01\n", "", f"{CONTROL}.deadline = none: expected one, for a task that has no"),
        ("period = 0.02\n", "", f"{ANGLE}.period = none: expected when plant sends"),
        ("period = 0.005", "period = 0.0005", "computers.node.tasks.telemetry.jitter = 0.001: expected less than the"),
        (ON_ARRIVAL, 'sampling = { on = "angle", period = 0.1 }', "components.filter.sampling.period = 0.1"),
        (ON_ARRIVAL, 'sampling = { on = "filtered" }', "components.filter.sampling.on = filtered: expected"),
        ('overrun = "abort"', 'overrun = "stop"', f"{CONTROL}.overrun = 'stop': expected 'queue', 'skip'"),
        ('kind = "ethernet"', 'kind = "can"', "networks.bus.latency = 1e-05: expected none but with kind ethernet"),
        ("bytes = 8\n", 'bytes = 8\nto = "plant"\n', f"{ANGLE}.to = plant: expected another node"),
        ("error = 0.1", "error = 1.0", "networks.bus.error = 1.0: expected a probability in [0, 1)"),
    ],
)
def test_invalid_values_are_rejected_by_name(file, old, new, complaint):
    assert old in FILE
    file.write_text(FILE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(UsageError) as error:
        load_system(file)
    assert complaint in str(error.value)


def test_frames_are_as_long_as_their_bits():
    def bits(kind, size, **keys):
        one: dict[str, Any] = {"identifier": 1, "slot": 0, "period": 1.0, "start": "a", "end": "b"}
        network = Network(kind=kind, bit_rate=1e9, **keys)
        return frame_nanoseconds(network, Message(bytes=size, **one))

    assert [bits("can", size) for size in (0, 1, 8)] == [55, 65, 135]
    assert bits("can", 8, stuffing="none") == 111
    assert [bits("ethernet", size) // 8 for size in (1, 46, 100)] == [84, 84, 138]
    assert bits("first-come-first-served", 10) == 80
    # 17 + 12 and 4 stuff bits; 5 + 8n, 4, the checksum with its fixed stuff bits, a delimiter and the other stuff bits
    fd = {size: bits("can-fd", size, data_bit_rate=1e9) for size in (0, 8, 9, 12, 64)}
    assert fd[0] == 33 + 5 + 4 + 23 + 1 + (21 // 4 - 4)
    assert fd[8] == 33 + 69 + 4 + 23 + 1 + (85 // 4 - 4)
    assert fd[9] == fd[12]
    assert fd[64] == 33 + 517 + 4 + 28 + 1 + (533 // 4 - 4)
    assert bits("can-fd", 8, data_bit_rate=5e8) == 33 + 2 * (fd[8] - 33)
