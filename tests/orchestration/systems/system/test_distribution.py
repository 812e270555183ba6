"""Distributions and traces: their tables in files, their values, and their keys."""

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.systems.schedule.lateness_and_loss import times_from
from orchestration.systems.system.component import Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.description import describe_faults, describe_varying
from orchestration.systems.system.distribution import Distribution, content, highest, is_random, lowest, mean
from orchestration.systems.system.file import load_system
from orchestration.systems.system.files import input_files

SYSTEM = """
stop_time = 1.0

[components.a]
fmu = "a.fmu"
step = 0.01

[components.b]
fmu = "b.fmu"
sampling = {{ period = 0.1 }}

[[connections]]
name = "x"
from = ["a.y"]
to = ["b.u"]
{}
"""


def read(folder: Path, line: str) -> Connection:
    """The connection of a system file that has this line in it."""
    (folder / "system.toml").write_text(SYSTEM.format(line))
    return load_system(folder / "system.toml").connections[0]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The folder of a trace."""
    (tmp_path / "trace.csv").write_text("delay,lost\n0.001,0\n0.004,1\n0.002,0\n")
    return tmp_path


@pytest.mark.parametrize(
    ("text", "expected", "words"),
    [
        ("{ uniform = [0, 0.05] }", Distribution(uniform=(0.0, 0.05)), "0 s to 50 ms uniform"),
        (
            "{ normal = [0.02, 0.01], range = [0, 0.05] }",
            Distribution(normal=(0.02, 0.01), range=(0.0, 0.05)),
            "20 ms ± 10 ms normal, cut to 0 s to 50 ms",
        ),
        ("{ values = [0.001, 0.2] }", Distribution(values=(0.001, 0.2)), "one of 1 ms, 200 ms"),
        (
            "{ values = [0.001, 0.2], probabilities = [0.25, 0.75] }",
            Distribution(values=(0.001, 0.2), probabilities=(0.25, 0.75)),
            "one of 1 ms (0.25), 200 ms (0.75)",
        ),
    ],
)
def test_a_delay_has_the_distribution_of_its_file(folder: Path, text: str, expected: Distribution, words: str) -> None:
    assert read(folder, f"delay = {text}").delay == expected
    assert describe_faults(read(folder, f"delay_jitter = {text}")) == f"delay jitter {words}"


def test_a_trace_is_found_beside_the_file_and_read_when_it_is_needed(folder: Path) -> None:
    delay = read(folder, 'delay = { file = "trace.csv", column = "delay" }').delay
    assert isinstance(delay, Distribution)
    assert (delay.file, lowest(delay), highest(delay)) == (folder / "trace.csv", 0.001, 0.004)
    assert describe_varying(delay) == "delay of trace.csv, drawn"
    assert is_random(delay)
    assert not is_random(replace(delay, order="as recorded"))


def test_a_system_is_written_as_it_was_read(folder: Path) -> None:
    lines = 'delay = { file = "trace.csv", column = "delay", order = "as recorded" }\nloss = { values = [0, 1] }'
    read(folder, lines)
    system = load_system(folder / "system.toml")
    assert input_files(system) == {"connections.x.delay": folder / "trace.csv"}
    (folder / "again.toml").write_text(system.to_toml())
    assert load_system(folder / "again.toml") == system


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("delay = { unifrom = [0, 1] }", "connections.0.delay.unifrom: no such key; expected one of uniform, normal"),
        ("delay = { uniform = 3 }", "connections.0.delay.uniform = 3: expected a valid array"),
        ("delay = { uniform = [1, 0] }", r"connections.x.delay.uniform = \[1.0, 0.0\]: expected two numbers from 0 on"),
        ("delay = {}", "connections.x.delay.distribution = nothing: expected one of uniform, normal, values, file"),
        ("delay = { uniform = [0, 1], values = [1] }", "distribution = uniform and values: expected one of"),
        ("delay = { normal = [1, 0.1] }", "connections.x.delay.range = none: expected the least and the largest value"),
        ("delay = { normal = [1, 0.1], range = [5, 6] }", r"delay.range = \[5.0, 6.0\]: expected one that has 1e-06"),
        ("delay = { values = [1, -2] }", "connections.x.delay.values = -2.0: expected zero or positive numbers"),
        ("delay = { values = [1, 2], probabilities = [0.5, 0.6] }", "probabilities = 1.1: expected a sum of 1"),
        ("delay = { values = [1, 2], probabilities = [1] }", "delay.probabilities = 1: expected 2, one a value"),
        ('delay = { file = "trace.csv" }', "connections.x.delay.column = none: expected the name of a column"),
        ('delay = { values = [1], order = "as recorded" }', "delay.order = as recorded: expected none without file"),
        ('delay = { file = "t.csv", column = "a", order = "x" }', "delay.order = 'x': expected 'drawn' or"),
        ("loss = { uniform = [0, 1] }", "connections.x.loss = a formula: expected a probability, or values or a file"),
        ("loss = { values = [0.5] }", "connections.x.loss.values = 0.5: expected 0 or 1"),
        ("loss = { values = [1] }\nburst_length = 2", "connections.x.burst_length = 2.0: expected none beside a loss"),
        (
            'delay_jitter = { values = [1] }\njitter_distribution = "normal"',
            "connections.x.jitter_distribution = normal: expected none beside a jitter that says its distribution",
        ),
        ('delay = "abc"', "connections.0.delay = 'abc': expected a valid number"),
    ],
)
def test_invalid_values_are_rejected_with_their_place(folder: Path, line: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        read(folder, line)


def test_a_lateness_stays_within_the_period() -> None:
    with pytest.raises(UsageError, match=r"jitter = 0\.2: expected less than the period of 0.1 s"):
        Sampling(period=0.1, jitter=Distribution(uniform=(0.0, 0.2)))


def test_a_trace_with_a_value_below_0_is_rejected_with_its_line(folder: Path) -> None:
    (folder / "trace.csv").write_text("delay\n0.001\n-0.004\n")
    with pytest.raises(UsageError, match=r"trace.csv: line 3: delay = -0.004: expected zero or positive numbers"):
        highest(Distribution(file=folder / "trace.csv", column="delay"))


def test_a_trace_that_is_written_anew_has_another_key(folder: Path) -> None:
    trace = Distribution(file=folder / "trace.csv", column="delay")
    before = content(trace)
    assert highest(trace) == 0.004
    (folder / "trace.csv").write_text("delay\n0.001\n0.0077\n")
    os.utime(folder / "trace.csv", ns=(1, 1))
    assert content(trace) != before
    assert highest(trace) == 0.0077


@pytest.mark.parametrize(
    ("of", "known"),
    [
        (Distribution(uniform=(0.001, 0.004)), 0.0025),
        (Distribution(values=(0.0, 0.004), probabilities=(0.25, 0.75)), 0.003),
        (Distribution(values=(0.001, 0.002, 0.006)), 0.003),
        (Distribution(normal=(0.002, 0.001), range=(0.001, 0.003)), 0.002),
        (Distribution(normal=(0.0, 1.0), range=(0.0, 9.0)), math.sqrt(2.0 / math.pi)),  # half a normal distribution
    ],
)
def test_the_mean_is_that_of_the_draws(of: Distribution, known: float) -> None:
    drawn = times_from(of)(np.random.default_rng(1).random(40_000)) / NANOSECONDS
    assert math.isclose(mean(of), known)
    assert math.isclose(drawn.mean(), known, rel_tol=0.02)
