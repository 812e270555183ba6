"""Random numbers belong to names: additions do not change those of others."""

import hashlib

import numpy as np
from hypothesis import given, settings

from orchestration.foundation.recording.recording import InMemory
from orchestration.simulation.engines.master import Master
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.systems.schedule.instant_arrays import Cursor
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from tests.extent import tries
from tests.orchestration.simulation.engines.random_systems import systems_with_more
from tests.orchestration.simulation.engines.stubs import Stub


def test_a_stream_is_made_as_documented():
    words = [
        int.from_bytes(hashlib.sha256(b"connections.valve.loss").digest()[4 * i : 4 * i + 4], "big") for i in range(4)
    ]
    expected = np.random.Generator(np.random.PCG64(np.random.SeedSequence(7, spawn_key=tuple(words))))
    assert Streams(7).of("connections.valve", "loss").random(5).tolist() == expected.random(5).tolist()


def test_a_stream_with_a_number_is_the_spawned_child_of_that_number():
    child = np.random.SeedSequence(7).spawn(4)[3]
    expected = np.random.Generator(np.random.PCG64(child)).random(5).tolist()
    assert Streams(7, {"connections.valve.loss": 3}).of("connections.valve", "loss").random(5).tolist() == expected


@settings(max_examples=tries(60, sampled=15))
@given(systems_with_more())
def test_adding_a_component_and_lossy_connections_changes_no_number_of_the_others(pair):
    """Samples, outcomes of messages and noise are compared: outputs are constant."""
    before, after = pair
    assert all(history(after, name) == history(before, name) for name in before.components)
    (rows, steps), (more_rows, more_steps) = noisy(before), noisy(after)
    for few, many in ((rows, more_rows), *((steps[name], more_steps[name]) for name in steps)):
        assert set(few) <= set(many)
        assert all(many[t].items() >= few[t].items() for t in few)


def history(what, name):
    """The samples of a component, and the outcomes of the messages that it reads and sends."""
    place, found = list(what.components).index(name), []
    for instant in Cursor(Timetable(what, Streams(what.seed))).instants():
        for due in (due for due in instant.samples if due.component == place):
            messages = [(what.connections[i].name, *message) for i, *message in (*due.received, *due.sent)]
            found.append((instant.time, {m for m in messages if len(m[0]) < len("c100")}))
        found += [message for message in posted(what, instant, name) if len(message[0]) < len("c100")]
    return found


def posted(what, instant, name):
    """The messages of a component in continuous time."""
    wires = what.connections
    return [(wires[i].name, *message) for i, *message in instant.posted if wires[i].sender == name]


def noisy(what):
    """Rows by time, and by component the inputs of its steps by their time, where no output ever changes."""
    inputs = {name: [end.partition(".")[2] for x in what.connections for end in x.end if x.receiver == name]
              for name in what.components}  # fmt: skip
    stubs = {name: Stub(y=1.0, z=2.0, **dict.fromkeys(names, 0.0)) for name, names in inputs.items()}
    streams = Streams(what.seed)
    clock, recorded = Timetable(what, streams), dict.fromkeys(stubs, ())
    master = Master(RunningSystem(what, stubs, timetable=clock, streams=streams, recorded=recorded), InMemory())
    master.initialise()
    master.run()
    chunks = master.recorder.finish().chunks()
    rows = [dict(zip(master.board.columns, row)) for chunk in chunks for row in chunk.rows.tolist()]
    tasks = {name for name, component in what.components.items() if component.sampling is not None}
    return {row["time"]: row for row in rows}, {
        name: {t: {key: seen[key] for key in inputs[name]} for t, _, seen in stubs[name].steps} for name in tasks
    }
