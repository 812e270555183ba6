"""Third-party files of computers and buses: tables of tasks, and CAN databases."""

import sys
from pathlib import Path

import pytest

from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.simulation.requests.resource_files import bus_of, computers_of, resources_of
from orchestration.systems.system.file import load_system
from orchestration.systems.system.proposal import propose
from quadcosim import schedule
from tests.commands import Main

TASKS = """\
name, period [ms], execution [us], priority, deadline, computer, overrun
control, 4, 900, 1, 0.003, flight,
radio, 20, 2500, 3, , payload, skip
logging, 0.1, 12.5, 4, , flight,
"""

DBC = """\
VERSION ""
NS_ :
BS_:
BU_: A B
BO_ 16 command: 8 A
 SG_ thrust : 0|16@1+ (0.1,0) [0|0] "N" B
BO_ 1 status: 4 B
 SG_ s : 0|16@1+ (1,0) [0|0] "" A
BO_ 99 event: 4 B
 SG_ s : 0|16@1+ (1,0) [0|0] "" A
BO_ 2147483660 long: 4 B
 SG_ s : 0|16@1+ (1,0) [0|0] "" A
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 16 10;
BA_ "GenMsgCycleTime" BO_ 1 5;
"""


def table(folder: Path, text: str) -> Path:
    path = folder / "tasks.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_row_is_a_task_with_times_in_the_unit_of_its_column(tmp_path: Path) -> None:
    control = {"period": 0.004, "execution": 0.0009, "deadline": 0.003}
    radio = {"period": 0.02, "execution": 0.0025, "priority": 3, "overrun": "skip"}
    logging = {"period": 0.0001, "execution": 1.25e-5, "priority": 4}
    assert computers_of(table(tmp_path, TASKS)) == {
        "flight": {"tasks": {"control": control, "logging": logging}},
        "payload": {"tasks": {"radio": radio}},
    }


def test_without_a_column_computer_it_is_named_after_the_file(tmp_path: Path) -> None:
    found = computers_of(table(tmp_path, "name,period,execution\na,1,0.1\n"))
    assert found == {"tasks": {"tasks": {"a": {"period": 1.0, "execution": 0.1}}}}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,execution,perod\n", "column perod: did you mean period"),
        ("name,execution [min]\n", "column execution .min.: unit min: expected s, ms, us"),
        ("name,period\n", "no column execution; expected some of name, computer"),
        ("name,period,execution\na,1,x\n", "line 2: execution = x: expected a number"),
        ("name,period,execution\na,1\n", "line 2: 2 values, expected 3 as in the header"),
        ("name,period,execution\na,1,-1\n", r"line 2: a: execution = -1\.0: expected zero or a positive number"),
        ("name,period,execution\na,1,0.1\na,1,0.1\n", "line 3: name = a: expected another one"),
        ("name,period,execution,priority\na,1,0.1,1.5\n", r"line 2: priority = 1\.5: expected a whole number"),
        ("name,period,execution\n", "expected a row for each task"),
    ],
)
def test_invalid_tasks_are_rejected_with_their_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        computers_of(table(tmp_path, text))


def test_messages_of_a_database_are_load_and_what_it_lacks_is_reported(tmp_path: Path) -> None:
    pytest.importorskip("cantools")
    (tmp_path / "bus.dbc").write_text(DBC)
    found = bus_of(tmp_path / "bus.dbc")
    assert found.networks == {
        "bus": {
            "kind": "can",
            "bit_rate": 500e3,
            "messages": {
                "status": {"bytes": 4, "identifier": 1, "period": 0.005},
                "command": {"bytes": 8, "identifier": 16, "period": 0.01},
            },
        }
    }
    assert found.guessed == ("bus.bit_rate is 500000, as bus.dbc does not have it",)
    assert found.undecided == (
        "bus.event: no cycle time; expected how often it is sent",
        "bus.long: identifier of 29 bits; expected one of 11",
    )


def test_a_file_that_is_no_database_is_rejected(tmp_path: Path) -> None:
    pytest.importorskip("cantools")
    (tmp_path / "bus.dbc").write_text("no database")
    with pytest.raises(UsageError, match=r"bus\.dbc: expected a CAN database: "):
        bus_of(tmp_path / "bus.dbc")


def test_without_cantools_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cantools", None)
    (tmp_path / "bus.dbc").write_text(DBC)
    with pytest.raises(QuadcosimError, match=r"cantools is not installed; this needs: pip install 'quadcosim\[can\]'"):
        bus_of(tmp_path / "bus.dbc")


def test_the_proposal_from_both_is_a_system_file(tmp_path: Path) -> None:
    pytest.importorskip("cantools")
    (tmp_path / "bus.dbc").write_text(DBC)
    resources, others = resources_of(["A.fmu", str(table(tmp_path, TASKS)), str(tmp_path / "bus.dbc")])
    assert others == ["A.fmu"]
    proposal = propose([], tmp_path, resources)
    assert all(f"# - {line}\n" in proposal.text for line in proposal.undecided)
    (tmp_path / "system.toml").write_text(proposal.text)
    system = load_system(tmp_path / "system.toml")
    assert list(system.computers) == ["flight", "payload"]
    assert system.computers["payload"].tasks["radio"].execution == 0.0025
    assert system.networks["bus"].messages["command"].identifier == 16


def test_two_files_with_a_computer_of_one_name_are_rejected(tmp_path: Path) -> None:
    path = str(table(tmp_path, TASKS))
    with pytest.raises(UsageError, match=r"computers\.flight: is in a file before it already"):
        resources_of([path, path])


def test_connect_proposes_computers_of_a_table_of_tasks(main: Main, tmp_path: Path) -> None:
    (tmp_path / "tasks.csv").write_text("name,period [ms],execution [us]\ncontrol,4,900\n")
    out = tmp_path / "system.toml"
    main("connect", str(tmp_path / "tasks.csv"), "--out", str(out))
    assert schedule(out).tasks["tasks.control"].jobs == 2500
