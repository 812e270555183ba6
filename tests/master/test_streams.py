"""Random numbers belong to names: nothing that is added changes another's."""

import hashlib

import numpy as np

from orchestration.master.agenda import Agenda
from orchestration.master.streams import Streams
from tests.master.stubs import continuous, sampled, system, wire


def test_a_stream_is_made_as_the_documents_say():
    words = [
        int.from_bytes(hashlib.sha256(b"connections.valve.loss").digest()[4 * i : 4 * i + 4], "big") for i in range(4)
    ]
    expected = np.random.Generator(np.random.PCG64(np.random.SeedSequence(7, spawn_key=tuple(words))))
    assert Streams(7).of("connections.valve", "loss").random(5).tolist() == expected.random(5).tolist()


def test_a_stream_with_a_number_is_the_spawned_child_of_that_number():
    child = np.random.SeedSequence(7).spawn(4)[3]
    expected = np.random.Generator(np.random.PCG64(child)).random(5).tolist()
    assert Streams(7, {"connections.valve.loss": 3}).of("connections.valve", "loss").random(5).tolist() == expected


def test_adding_components_and_lossy_connections_changes_no_number_of_the_others():
    parts = {"tank": continuous(), "controller": sampled(jitter=0.05)}
    wires = [wire("tank.level", "controller.level", "level"), wire("controller.valve", "tank.valve", "valve", loss=0.3)]
    more = {"display": sampled(0.07, jitter=0.03), **parts, "pump": continuous(0.03)}
    others = [wire("tank.level", "display.level", "shown", loss=0.5, delay_jitter=0.1), *wires]
    before, after = history(system(parts, wires, seed=3)), history(system(more, others, seed=3))
    assert before == after
    assert len(before) > 8


def history(what):
    """When the controller samples, and what becomes of its messages."""
    place = list(what.components).index("controller")
    dues = (due for instant in Agenda(what, Streams(what.seed)) for due in instant.due if due.component == place)
    return [(due.time, [(message.sent, message.arrival) for message in due.sent]) for due in dues]
