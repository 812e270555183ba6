"""A sweep of FMUs that keep state over a reset gives the rows of fresh processes, through the commands."""

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from orchestration.experiments.studies.store import store_path
from orchestration.experiments.studies.table import frame
from tests.commands import Main
from tests.orchestration.components.fmi.small import needs_compiler, nothing_known, small

pytestmark = needs_compiler

HABITS = {"broken": ["BROKEN_RESET"], "statics": ["STATICS"], "both": ["BROKEN_RESET", "STATICS"]}
FMUS = {**{name: name for name in HABITS}, "twin": "statics"}
"""The FMU of each component; one of them twice in a process"""
GAINS = (3.0, 2.0, 1.0)
SYSTEM = f"""
stop_time = 0.1
sources.one = {{ constant = 1.0, to = {[f"{name}.u" for name in FMUS]} }}
[components]
{"".join(f'{name} = {{ fmu = "{fmu}/small.fmu", step = 0.01 }}' + chr(10) for name, fmu in FMUS.items())}
[objectives]
{"".join(f'{name} = "last({name}.y)"' + chr(10) for name in FMUS)}
"""
STUDY = f"""
name = "study"
keep_signals = true
scenario = "system.toml"
[[axes]]
name = "gain"
sets = {[f"components.{name}.parameters.gain" for name in FMUS]}
values = {list(GAINS)}
"""


def test_rows_and_signals_of_a_sweep_are_those_of_a_run_of_each(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing_known(tmp_path / "cache", monkeypatch)
    for name, habits in HABITS.items():
        small(tmp_path / name, *habits)
    (tmp_path / "system.toml").write_text(SYSTEM, encoding="utf-8")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    main("sweep", tmp_path / "study.toml", "--workers", "1", "--out", tmp_path / "swept")
    table = frame(store_path("study", tmp_path / "swept"))
    assert len(table) == len(GAINS)
    for gain, (_, swept) in zip(GAINS, table.iterrows(), strict=True):
        settings = [word for name in FMUS for word in ("--set", f"components.{name}.parameters.gain={gain}")]
        kept = ("--out", tmp_path / f"run-{gain}", "--no-figures")
        alone = json.loads(main("run", tmp_path / "system.toml", *settings, *kept, "--json").stdout)
        assert {name: swept[name] for name in FMUS} == {name: alone[name] for name in FMUS}
        assert alone["twin"] == alone["statics"]
        signals = pq.read_table(tmp_path / "swept" / "signals" / f"{swept['key'][:16]}.parquet")
        assert signals.equals(pq.read_table(tmp_path / f"run-{gain}" / "signals.parquet").select(signals.column_names))
