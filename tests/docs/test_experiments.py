"""The batches behind the findings are the flights of the FMUs; what is concluded from them is computed rightly."""

import math

import numpy as np
import pytest

import orchestration as quadcosim
from docs import batch, experiments
from docs.make_findings import as_scenario, flying_up_to

STOP = 2.0


def test_a_batch_is_the_flights_of_the_fmus() -> None:
    chosen = {
        "period": np.array([0.02, 0.0125, 0.05]), "delay": np.array([0.0, 0.02, 0.005]),
        "kappa": np.array([1.0, 0.3, 0.0]), "gain_factor": np.array([1.0, 1.2, 0.8]),
        "surface": np.array([5.0, 3.0, 6.0]), "lag": np.array([0.0, 0.01, 0.0]),
        "start": (np.array([0.0, 1.0, -0.5]), np.array([0.0, -1.0, 0.7]), np.array([0.0, 2.5, 1.0])),
    }  # fmt: skip
    flown = batch.fly(batch.Flights(**chosen), STOP)
    for i in range(3):
        metrics = quadcosim.run(as_scenario(chosen, i).with_changes(stop_time=STOP)).metrics
        assert flown.ultimate_bound[i] == pytest.approx(metrics["ultimate_bound"], rel=1e-3)  # seen at other instants
        assert not flown.diverged[i]


def test_a_flight_of_a_batch_diverges_where_the_fmus_do_and_leaves_the_others_alone() -> None:
    periods = np.array([0.2, 0.01, 0.19])
    flown = batch.fly(batch.Flights(period=periods), 6.0)
    assert flown.diverged.tolist() == [True, False, True]
    alone = batch.fly(batch.Flights(period=periods[1]), 6.0)
    assert flown.ultimate_bound[1] == alone.ultimate_bound[0]
    assert math.isnan(flown.ultimate_bound[0])


def test_many_samples_come_near_continuous_time() -> None:
    sampled = batch.fly(batch.Flights(period=0.001, kappa=np.array([0.0, 1.0])), 0.5)
    continuous = batch.fly_continuously(batch.Flights(kappa=np.array([0.0, 1.0])), 0.5)
    assert sampled.ultimate_bound == pytest.approx(continuous.ultimate_bound, rel=2e-3)


def test_the_first_end_is_before_the_first_period_that_does_not_fly() -> None:
    flew = np.ones((3, len(experiments.PERIODS)), bool)
    flew[0, 4] = flew[0, 7] = flew[1, 0] = False
    last = experiments.PERIODS[-1]
    assert experiments.first_ends(flew).tolist() == [experiments.PERIODS[3], 0.0, last]


def test_what_diverged_comes_last_in_rank_and_shares_it() -> None:
    assert experiments.ranks(np.array([0.3, np.nan, 0.1, np.nan])) == pytest.approx([1 / 3, 2.5 / 3, 0.0, 2.5 / 3])


def test_an_island_is_told_beside_the_first_end() -> None:
    import pandas as pd

    outcomes = ["settled", "bounded", "settled", "diverged"]
    good = [float(outcome == "settled") for outcome in outcomes]
    table = pd.DataFrame({"k": 1.0, "period": [0.01, 0.02, 0.03, 0.04], "outcome": outcomes, "good": good})
    (line,) = flying_up_to(table, "k", "period")
    assert line == "k 1: flies up to period 0.01; again at [0.03], bounded at [0.02]"
