"""Runs the flights of `docs/findings`, draws its figures, keeps its numbers in `docs/data`, and writes its claims.

Run as `make findings`. `python -m docs.make_findings NAME …` does only some sections, by the names of their functions.
It continues where it was stopped: its stores are in `results/findings`.
"""

import dataclasses
import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import quadcosim
from docs import charts, claim_records, comparisons, theory
from docs import processor as processors
from docs.theory import PAPER
from orchestration.experiments.comparison.cells import FATES, SETTLING, survived
from orchestration.experiments.comparison.run import rerun_cells
from orchestration.experiments.limits import figure, limit
from orchestration.experiments.studies import drawing, figures
from orchestration.experiments.studies.missing_runs import AGREEMENT
from orchestration.experiments.studies.store import open_for_reading, store_path
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.sweep import sweep
from orchestration.foundation.basics.statistics import first_end, quantile, wilson
from orchestration.quadrotor.flight.hover_limit import about_hover, margin_of
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.simulation.figures.style import DOCS, save
from orchestration.simulation.workers.batching import LaneAgreement

Found = dict[str, Any]

ROOT = Path(__file__).parent.parent
FIGURES = Path(__file__).parent / "figures"
RESULTS = ROOT / "results" / "findings"
KAPPAS = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 15.0)
GAINS = {
    "gains_period": "κ = 1 held: its weight 2κ/k_q falls as the gains rise",
    "gains_period_scaled": "κ scaled with the gains: the weight held",
    "gains_period_uncoupled": "κ = 0",
}
RANDOM = {"loss": 0.25, "jitter": 0.0095, "position_noise": 0.0017, "inertia_factor": 1.0}
"""The axes of the Monte Carlo study, each with its middle"""
CONTINUOUS = (0.00005, 0.0001)
"""Periods that approximate continuous time [s], if both have the same outcomes"""
DESIGNS = 4
"""Designs of Sobol indices"""


def main() -> None:
    """All sections, in the order of the pages."""
    began = time.perf_counter()
    for name, section in SECTIONS.items():
        if name in sys.argv[1:] or not sys.argv[1:]:
            print(f"\n## {name}", flush=True)
            found = section()
            if found:
                comparisons.keep(name, found)
                print(json.dumps(found, ensure_ascii=False, indent=1, default=str), flush=True)
    print(*claim_records.write(), sep="\n")
    print(f"\n{(time.perf_counter() - began) / 60:.1f} min")


# -- sections ---------------------------------------------------------------------------------------------


def compared() -> Found:
    """Controllers from the same initial conditions: limits and cells of every comparison, kept by its name."""
    for name in comparisons.NAMES:
        print(*comparisons.lines(name, comparisons.run_missing(name)), sep="\n", flush=True)
    return {}


def pictures() -> Found:
    """Figures of the comparisons from docs/data, without running flights."""
    with DOCS.applied():
        drawn = dict(comparisons.figures())
    print(*map(str, save(drawn, FIGURES, DOCS)), sep="\n")
    return comparisons.from_the_path()


def last_bits() -> Found:
    """By how many flights the cells of two maps change if all initial errors grow by 1e-15."""
    found = {}
    for name in ("mismatches", "vehicles"):
        known, kept = comparisons.load(name), comparisons.read_data(name)["cells"]
        sizes = {
            size: getattr(known.starts, size) * (1.0 + 1e-15) for size in ("position", "velocity", "angle", "rate")
        }
        moved = dataclasses.replace(known, starts=dataclasses.replace(known.starts, **sizes))
        again = rerun_cells(moved, range(len(kept)), workers=comparisons.WORKERS, engine="batch")
        found[name] = {"cells": len(kept)}
        for fate in ("survives", "settles"):
            by = np.array([abs(getattr(new, fate).count - old[fate]) for new, old in zip(again, kept, strict=True)])
            found[name] |= {f"{fate}_differ": int(np.count_nonzero(by)), f"{fate}_by": int(by.max())}
    return found


def period() -> Found:
    """Tracking error over the period, and the periods that do not survive and settle."""
    table = run_study_file("period")
    draw("period", "total_variation.torque")
    columns = ["period", "position_rmse", "settling_time", "ultimate_bound", "total_variation.torque"]
    shown = table[table["period"].isin([0.001, 0.01, 0.02, 0.05, 0.07])]
    without = quadcosim.run(PAPER.with_changes(parameters=theory.CALM)).metrics["ultimate_bound"]
    return {**fates(table), "flown": shown[columns].to_dict("records"), "residual_without_wind": without}


def limits() -> Found:
    """Limits of the period over kappa."""
    rows = []
    for kappa in KAPPAS:
        paper = PAPER.with_changes(parameters={"controller.coupling": kappa})
        found = limit.limit(paper, "period", progress=None, announce=None)
        rows.append({"coupling": kappa, "local": found.local_limit, "settles": found.large_signal_limit,
                     "again": found.flies_above, "note": "; ".join(found.notes)})  # fmt: skip
        if kappa == 1.0:
            figure.draw_spectral_radius(paper, found, FIGURES, DOCS)
    return {"limits": rows}


def continuous() -> Found:
    """The same flights near continuous time, and the settling of those with much coupling."""
    table = run_study_file("continuous")
    columns = ["coupling", "period", "outcome", "settling_time", "ultimate_bound"]
    rows = table.sort_values(columns[:2], kind="stable")[columns].to_dict("records")
    return {**fates(table), "changed_by_halving": changed_by_halving(table, "coupling"), "flown": rows}


def delay() -> Found:
    """Limits of the loop with a delay, and with another kappa."""
    found: Found = {}
    for name, by, axis in (("period_delay", "period", "delay"), ("period_coupling", "coupling", "period")):
        table = run_study_file(name)
        draw(name, "position_rmse")
        found |= {f"{name}_{key}": value for key, value in fates(table).items()}
        found[name] = ends(table, by, axis)
    return found


def gains() -> Found:
    """Limits of the period over the gain factor, for three ways of scaling kappa."""
    tables = {name: run_study_file(name) for name in GAINS}
    found = {name: ends(table, "gain_factor", "period") for name, table in tables.items()}
    factors = np.array([one["gain_factor"] for one in found["gains_period"]])
    local = np.array([about_hover(_uncoupled(factor), "period").limit for factor in factors])
    drawn = {GAINS[name]: {fate: np.array([one[fate] for one in rows], float) for fate in FATES}
             for name, rows in found.items()}  # fmt: skip
    _save(lambda: charts.gain_limits(factors, drawn, local), "gain_limits")
    changed = {f"{name}_changed_by_halving": changed_by_halving(table, "gain_factor") for name, table in tables.items()}
    return {
        **found,
        **changed,
        **{f"{name}_fates": fates(table) for name, table in tables.items()},
        "local": local.tolist(),
    }


def energy() -> Found:
    """The energy along the paper's flight without wind, for three weights of the coupling."""
    curves = {kappa: theory.energy_over_time(kappa) for kappa in theory.ENERGIES}
    _save(lambda: charts.energy(curves), "energy")
    return {"flights": [theory.rises_of(kappa, *curve) for kappa, curve in curves.items()]}


def finite_time() -> Found:
    """Decay of error and energy over the exponent, inside and outside of the boundary layer."""
    table = run_study(theory.decay_study())
    rows, medians = [], []
    for (exponent, period), group in table.groupby(["exponent", "period"], sort=False):
        times = theory.since(group)
        inside, rates = times[:, theory.BOUNDS.index(theory.LAYER)], theory.rates_of(times)
        reached = inside[~np.isnan(inside)]
        rows.append({
            "exponent": exponent, "period": period, "inside": len(reached), "count": len(inside),
            "interval": [*wilson(len(reached), len(inside))], "remains": float(np.median(group["remains"])),
            "from": median(reached) if len(reached) == len(inside) else None,
            "rates": [None if np.isnan(column).any() else median(column) for column in rates.T],
            "expected": theory.expected_rate(exponent),
        })  # fmt: skip
        if period == theory.DECAY_PERIODS[0]:
            medians.append(np.median(rates, axis=0))
    hover = []
    for kappa in (0.0, 1.0):
        loop = HoverLoop.of(PAPER.with_changes(parameters={"controller.coupling": kappa}))
        slowest = [-float(np.log(loop.spectral_radius(T, 0.0))) / T for T in theory.DECAY_PERIODS]
        hover.append({"coupling": kappa, "slowest": slowest})
    curves = {exponent: theory.error_over_time(exponent)[:2] for exponent in theory.EXPONENTS}
    _save(lambda: charts.decay(curves, np.array(medians)), "decay")
    promised = [theory.promised(exponent, *curve) for exponent, curve in curves.items() if exponent < 1.0]
    return {"decay": rows, "hover": hover, "energy_rates": theory.energy_rates(), "promised": promised}


def bandwidth() -> Found:
    """The gains that set the local limit of the period: exponents, one gain and one loop at a time."""
    rows = []
    for kappa in (0.0, 1.0):
        found = theory.limits_over_gains(kappa)
        for name, values in found.items():
            slope, low, high = theory.exponent_of(theory.FACTORS, values)
            rows.append({"coupling": kappa, "scaled": name, "exponent": slope, "low": low, "high": high,
                         "limits": values.tolist()})  # fmt: skip
        if kappa == 0.0:
            _save(lambda found=found: charts.loop_gains(found), "loop_gains")  # type: ignore[misc]
    alone = [theory.of_attitude_alone(15.0 * f, 15.0 * f, 15.0 * f) for f in theory.FACTORS]
    return {"scaled": rows, "attitude_alone": alone}


def bounds() -> Found:
    """Delays that hover tolerates, by theory."""
    found = [margin_of(PAPER.with_changes(timing={"period": T})) for T in theory.MARGIN_PERIODS]
    keys = ("delay_limit", "certain_jitter", "breaking_jitter")
    columns = [np.array([getattr(one, key) for one in found]) for key in keys]
    _save(lambda: charts.margins(*columns), "margins")
    return {"margins": [{key: getattr(one, key) for key in ("period", *keys, "breaking_sequence")} for one in found]}


def certificates() -> Found:
    """Late samples and late commands together: certified values, and values that break hover."""
    slow = PAPER.with_changes(timing={"period": 0.04})
    found = quadcosim.margin_region(slow, "components.controller.sampling.jitter", "connections.command.delay_jitter")
    _save(lambda: found.figure(DOCS), "margin_region")
    return {"certified": [*map(list, found.certified)], "breaking": [*map(list, found.breaking)]}


def wind() -> Found:
    """The exact costs of a white force about hover over period and delay, compared with runs."""
    costs = theory.costs_of_wind()
    _save(lambda: charts.wind(costs), "wind")
    finite = costs["radius"] < 1.0
    found: Found = {"finite": int(finite.sum()), "of": finite.size, "compared": []}
    for name in theory.WIND_COSTS:
        found[name] = [float(costs[name][finite].min()), float(costs[name][finite].max())]
    for period, delay in theory.WIND_RUNS:
        for name, squares in theory.squares_in_wind(period, delay).items():
            exact = costs[name][theory.WIND_DELAYS.index(delay), theory.WIND_PERIODS.index(period)]
            mean, width = float(np.sqrt(squares.mean())), 2.13 * squares.std(ddof=1) / np.sqrt(len(squares))
            found["compared"].append({"period": period, "delay": delay, "cost": name, "exact": float(exact),
                                      "runs": len(squares), "flown": mean, "width": width / (2.0 * mean)})  # fmt: skip
    return found


def monte_carlo() -> Found:
    """How many survive and settle, and rank correlations of the survivors' errors with each axis."""
    table = run_study_file("monte_carlo")
    draw("monte_carlo", "ultimate_bound")
    alive, groups = survived(table), {"all": table}
    for axis, edge in RANDOM.items():
        groups |= {f"{axis} < {edge:g}": table[table[axis] < edge], f"{axis} >= {edge:g}": table[table[axis] >= edge]}
    shares = [{"group": name, **{fate: share(has(group)) for fate, has in FATES.items()}}
              for name, group in groups.items()]  # fmt: skip
    among = {"survive": table[alive], "loss < 0.25": table[alive & (table["loss"] < RANDOM["loss"])]}
    correlations = [
        {"among": name, "metric": metric, "median": median(group[metric]),
         **{axis: rank_correlation(group[axis], group[metric]) for axis in RANDOM}}
        for name, group in among.items() for metric in ("ultimate_bound", "position_rmse")
    ]  # fmt: skip
    return {**fates(table), "shares": shares, "correlations": correlations}


def sensitivity() -> Found:
    """Sobol indices of several designs: of surviving, of settling, and of settling soon."""
    study = load_study(ROOT / "studies" / "sensitivity.toml")
    questions: Mapping[str, Callable[[Any], Any]] = {**FATES, "settle by 6.7 s": lambda table: table[SETTLING] <= 6.7}
    tables = {seed: run_study(_design(study, seed)) for seed in range(DESIGNS)}
    draw("sensitivity", "good")
    rows, shares = [], {}
    for name, has in questions.items():
        designs = [drawing.indices_of(_design(study, seed), has(table).to_numpy(float), "outcome")
                   for seed, table in tables.items()]  # fmt: skip
        shares[name] = [float(has(table).mean()) for table in tables.values()]
        for several in zip(*designs, strict=True):  # of one kind and axis
            values, widths = np.array([(one.value, one.confidence) for one in several]).T
            mean = values.mean()
            rows.append({"question": name, "kind": several[0].kind, "axis": several[0].axis, "mean": float(mean),
                         "width": float(widths.max()), "designs": values.tolist(),
                         "hold_the_mean": int((np.abs(values - mean) <= widths).sum())})  # fmt: skip
    return {**fates(pd.concat(tables.values())), "shares": shares, "indices": rows}


def agreement() -> Found:
    """The agreement of flights in SIMD lanes with the same flights by FMUs, store by store."""
    found = {}
    for path in sorted(RESULTS.glob("*/study.sqlite")):
        with open_for_reading(path) as opened:
            found[path.parent.name] = str(LaneAgreement.from_text(opened.about()[AGREEMENT]))
    return found


def processor() -> Found:
    """The processor share of each design, compared with its performance."""
    _save(processors.figure, "processor")
    return {"designs": processors.equal_share()}


def stalls() -> Found:
    """For how long the law may be blocked from the processor."""
    found = processors.stalls()
    _save(lambda: processors.errors(found), "stalls")
    return {"laws": processors.stall_table(found)}


SECTIONS: Mapping[str, Callable[[], Found]] = {
    section.__name__: section
    for section in (
        compared, pictures, last_bits, period, limits, continuous, delay, bounds, certificates, wind, gains, bandwidth,
        energy, finite_time, monte_carlo, sensitivity, agreement, processor, stalls,
    )
}  # fmt: skip


# -- counts -----------------------------------------------------------------------------------------------


def fates(table: pd.DataFrame) -> Found:
    """How many survive and settle, and from when on: whether another horizon would change the result."""
    counts = {fate: int(has(table).sum()) for fate, has in FATES.items()}
    return {"flights": len(table), **counts, **comparisons.by_horizon(table)}


def ends(table: pd.DataFrame, by: str, axis: str) -> list[Found]:
    """For each value of one axis: the value of the other up to which flights survive and settle, and those beyond."""
    rows = []
    for value, group in table.sort_values(axis).groupby(by, sort=True):
        row: Found = {by: value}
        for fate, has in FATES.items():
            row[fate] = end = first_end(group[axis], has(group))
            beyond = group[has(group) & (group[axis] > (-np.inf if end is None else end))]
            row[f"{fate}_again"] = sorted(beyond[axis].to_list())
        rows.append(row)
    return rows


def changed_by_halving(table: pd.DataFrame, by: str) -> list[float]:
    """The values at which outcomes change when the period that approximates continuous time is halved."""
    fine, coarse = (table[table["period"] == period].set_index(by) for period in CONTINUOUS)
    return [float(value) for value in fine.index if fine["outcome"][value] != coarse["outcome"][value]]


def share(has: pd.Series) -> Found:
    """The number of runs that have a fate, and the share with its Wilson interval."""
    low, high = wilson(int(has.sum()), len(has))
    return {"count": int(has.sum()), "of": len(has), "low": low, "high": high}


def rank_correlation(x: pd.Series, y: pd.Series) -> list[float]:
    """Spearman's rank correlation, with its 95 % interval by the bootstrap."""
    from scipy.stats import bootstrap, spearmanr

    def of(x: Any, y: Any) -> float:
        return float(spearmanr(x, y).statistic)

    found = bootstrap(
        (x.to_numpy(float), y.to_numpy(float)), of, paired=True, vectorized=False, n_resamples=1000,
        method="percentile", random_state=np.random.default_rng(1),
    ).confidence_interval  # fmt: skip
    return [of(x, y), float(found.low), float(found.high)]


def median(values: Any) -> list[float]:
    """The median of some values, with its interval."""
    return [*map(float, quantile(values)[:3])]


# -- running and drawing ----------------------------------------------------------------------------------


def run_study_file(name: str) -> pd.DataFrame:
    """The table of a study file, after running the missing flights."""
    return run_study(load_study(ROOT / "studies" / f"{name}.toml"))


def run_study(study: Study) -> pd.DataFrame:
    """The table of a study, after running the missing flights in lanes."""
    return sweep(study, out=RESULTS / study.name, workers=comparisons.WORKERS, engine="batch").to_pandas()


def draw(name: str, metric: str) -> None:
    """Write the figure of a study, as its command draws it, into the docs; for two axes, the map."""
    study = load_study(ROOT / "studies" / f"{name}.toml")
    drawn, _ = drawing.study_figures(study, store_path(name, RESULTS / name), metric, DOCS)
    save({f"study_{name}": [*drawn.values()][-1]}, FIGURES, DOCS)


def _save(make: Callable[[], Any], name: str) -> None:
    figures.save(lambda style: make(), FIGURES / name, DOCS)


def _design(study: Study, seed: int) -> Study:
    return dataclasses.replace(study, design_seed=seed, name=f"{study.name}_{seed}" if seed else study.name)


def _uncoupled(factor: float) -> Any:
    """The paper's flight with κ = 0 and its attitude gains times a factor."""
    return theory.scaled(theory.ATTITUDE, factor, PAPER.with_changes(parameters={"controller.coupling": 0.0}))


if __name__ == "__main__":
    main()
