import random
from dataclasses import replace
from typing import Any

import pytest

from orchestration.simulation.engines.wasm.tables_of_system import tables_of
from orchestration.simulation.requests.request import request_of
from quadcosim import ReferenceChoice, Scenario, fly
from tests.orchestration.simulation.engines.wasm.machines import Native, Page, hashes_of, library_of, tables
from tests.places import ROOT

COLUMNS = ("plant.position.x", "plant.position.z", "plant.quaternion.w", "plant.thrust", "controller.torque.y")
PATHS = {
    "timing.period": "components.controller.sampling.period",
    "timing.offset": "components.controller.sampling.offset",
    "timing.jitter": "components.controller.sampling.jitter",
    "timing.clock_ratio": "components.controller.sampling.clock_ratio",
    "timing.plant_interval": "components.plant.step",
    "timing.delay": "connections.command.delay",
    "timing.delay_jitter": "connections.command.delay_jitter",
    "timing.command_loss": "connections.command.loss",
    "timing.measurement_loss": "connections.measurement.loss",
    "controller.coupling": "components.controller.parameters.coupling",
    "controller.trajectory.frequency": "components.controller.parameters.trajectory.frequency",
    "plant.initial.position.x": "components.plant.parameters.initial.position.x",
    "plant.mass": "components.plant.parameters.mass",
    "seed": "seed",
}
STOP = 2.0


def random_request(r):
    """Values by path of a scenario, each of the kinds that people write."""
    period = round(
        r.choice([0.001, 0.0025, 1 / 300, 0.0071, 0.01, 0.02, 0.05]) * r.uniform(0.8, 1.2), r.choice([4, 9, 17])
    )
    some = {
        "timing.offset": round(r.uniform(0.0, 0.03), 7),
        "timing.jitter": round(period * r.uniform(0.05, 0.9), 9),
        "timing.clock_ratio": r.choice([1.0, 0.9999, 1.00125]),
        "timing.plant_interval": round(r.uniform(0.0008, 0.006), r.choice([4, 6, 10])),
        "timing.delay": round(r.uniform(0.0, 0.05), r.choice([3, 6, 10])),
        "timing.delay_jitter": round(r.uniform(0.0, 0.04), 9),
        "timing.command_loss": r.choice([0.05, 0.3, 0.7]),
        "timing.measurement_loss": r.choice([0.05, 0.3, 0.7]),
        "controller.coupling": r.uniform(0.0, 15.0),
        "controller.trajectory.frequency": r.uniform(0.1, 1.0),
        "plant.initial.position.x": r.uniform(-3.0, 3.0),
        "plant.mass": r.uniform(0.5, 2.0),
        "seed": r.choice([1, 20, 2**31, 2**40 + 5, 592127930700]),
    }
    return {"timing.period": period, **{path: value for path, value in some.items() if r.random() < 0.4}}


def requests():
    r = random.Random(11)
    return [random_request(r) for _ in range(20)]


def page_of(of):
    """The page of these tables, as a library of this machine."""
    settings = {setting.path: setting.value for setting in of.settings.all}
    return Page(Native(library_of(of)), settings, of.shape.place, [*of.shape.nodes])


def hashes(page, runs):
    return [page.fly([{PATHS[path]: value for path, value in run.items()}], COLUMNS)[0][0] for run in runs]


@pytest.fixture(scope="module")
def of_one_lane():
    return tables(Scenario(stop_time=STOP), 1)


@pytest.fixture(scope="module")
def expected():
    defaults = {path: [value] for path, value in {
        "timing.period": 0.01, "timing.offset": 0.0, "timing.jitter": 0.0, "timing.clock_ratio": 1.0,
        "timing.plant_interval": 0.001, "timing.delay": 0.0, "timing.delay_jitter": 0.0, "timing.command_loss": 0.0,
        "timing.measurement_loss": 0.0, "controller.coupling": 1.0, "controller.trajectory.frequency": 0.15,
        "plant.initial.position.x": 0.0, "plant.mass": 1.0, "seed": 0,
    }.items()}  # fmt: skip
    runs = requests()
    values = {path: [run.get(path, default) for run in runs] for path, (default,) in defaults.items()}
    flights = fly(Scenario(stop_time=STOP), values, record=COLUMNS)
    assert flights.reason is None
    return hashes_of(flights, COLUMNS)


def test_the_c_of_a_page_has_the_rows_of_fly_to_the_bit(of_one_lane, expected):
    assert hashes(page_of(of_one_lane), requests()) == expected


def test_a_wrong_constant_of_a_stream_changes_rows(of_one_lane, expected):
    key = of_one_lane.timing.index("{{0u}, 1}")  # of the jitter of samples
    wrong = replace(of_one_lane, timing=of_one_lane.timing[:key] + "{{5u}, 1}" + of_one_lane.timing[key + 9 :])
    found = hashes(page_of(wrong), requests())
    changed = [run for run, own, other in zip(requests(), found, expected) if own != other]
    assert changed == [run for run in requests() if "timing.jitter" in run]


def test_a_page_refuses_what_a_request_would(of_one_lane):
    page = page_of(of_one_lane)
    period, jitter, loss = (PATHS[f"timing.{key}"] for key in ("period", "jitter", "command_loss"))
    refused = [page.fly([values], COLUMNS) for values in ({jitter: 0.01}, {period: 0.0}, {loss: 1.5}, {period: 1e-7})]
    assert refused == [(5, jitter), (1, period), (2, loss), (9, period)]


@pytest.mark.parametrize("name", ["three_servos/can.toml", "references/lemniscate.toml"])
def test_timing_and_sources_that_a_page_cannot_compute_are_given_to_it(name):
    loaded: Any = request_of(ROOT / "examples" / name)
    request = replace(loaded, stop_time=0.3)
    of = tables(request, 1)
    columns = of.shape.board.columns[1:]
    flown = fly(request, {"stop_time": [0.3]}, record=columns)
    page = page_of(of)
    assert page.fly([{}], columns)[0][0] == hashes_of(flown, columns)[0]
    assert not [path for path in of.settings.at if path.endswith((".sampling.period", ".delay", ".jitter", ".loss"))]
    assert page.fly([{"stop_time": 0.2}], columns) == (1, "stop_time")


def test_motions_of_sums_and_products_are_computed_by_a_page_under_any_clock():
    request = Scenario(stop_time=2.5, reference=ReferenceChoice(name="step"))
    of = tables(request, 1)
    flown = fly(request, {"timing.period": [0.013]}, record=COLUMNS)
    assert hashes(page_of(of), [{"timing.period": 0.013}]) == hashes_of(flown, COLUMNS)


def test_settings_have_a_place_each(of_one_lane):
    assert tables_of(of_one_lane.shape).settings.at == of_one_lane.settings.at
