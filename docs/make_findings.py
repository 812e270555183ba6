"""Runs the flights of `docs/findings`, draws its figures and prints its numbers: run as `make findings`.

`python -m docs.make_findings NAME …` does only some sections, by the names of their functions. It continues where it
was stopped: its stores are in `results/findings`.
"""

import dataclasses
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import quadcosim
from docs import charts, comparisons, theory
from docs import processor as processors
from docs.finding_texts import (
    all_in_ms,
    changed_by_halving,
    fates,
    first_ends,
    in_ms,
    listed,
    median_with_interval,
    rank_correlation,
    share,
    up_to,
)
from docs.theory import PAPER
from orchestration.experiments.comparison.run import rerun_cells
from orchestration.experiments.comparison.survival import FATES, SETTLING, survived
from orchestration.experiments.limits import figure, limit
from orchestration.experiments.studies import drawing, figures
from orchestration.experiments.studies.store import open_for_reading, store_path
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.sweep import AGREEMENT, sweep
from orchestration.foundation.basics.statistics import wilson
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.quadrotor.flight.local_limit import about_hover
from orchestration.quadrotor.flight.margin import margin_of
from orchestration.simulation.figures.style import DOCS, save
from orchestration.simulation.workers.batching import LaneAgreement

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
    """All sections, in the order of the page."""
    began = time.perf_counter()
    sections = (
        compared, pictures, last_bits, period, limits, continuous, delay, bounds, certificates, wind, gains, bandwidth,
        finite_time, monte_carlo, sensitivity, agreement, processor, stalls,
    )  # fmt: skip
    for section in [one for one in sections if one.__name__ in sys.argv[1:] or not sys.argv[1:]]:
        print(f"\n## {section.__name__}", flush=True)
        for line in section():
            print(line, flush=True)
    print(f"\n{(time.perf_counter() - began) / 60:.1f} min")


# -- sections ---------------------------------------------------------------------------------------------


def compared() -> list[str]:
    """Controllers from the same initial conditions: limits and cells of every comparison."""
    found = {name: comparisons.run_missing(name) for name in comparisons.NAMES}
    return [line for name, content in found.items() for line in comparisons.lines(name, content)]


def pictures() -> list[str]:
    """Figures of the comparisons from docs/data, without running flights."""
    with DOCS.applied():
        drawn = dict(comparisons.figures())
    return [*map(str, save(drawn, FIGURES, DOCS)), comparisons.from_the_path()]


def last_bits() -> list[str]:
    """By how many flights the cells of two maps change if all initial errors grow by 1e-15."""
    lines = []
    for name in ("mismatches", "vehicles"):
        known, kept = comparisons.load(name), comparisons.read_data(name)["cells"]
        sizes = {
            size: getattr(known.starts, size) * (1.0 + 1e-15) for size in ("position", "velocity", "angle", "rate")
        }
        moved = dataclasses.replace(known, starts=dataclasses.replace(known.starts, **sizes))
        again = rerun_cells(moved, range(len(kept)), workers=comparisons.WORKERS, engine="batch")
        pairs = [*zip(again, kept, strict=True)]
        survive = np.array([abs(new.survives.count - old["survives"]) for new, old in pairs])
        settle = np.array([abs(new.settles.count - old["settles"]) for new, old in pairs])
        lines.append(
            f"{name}: of {len(kept)} cells {np.count_nonzero(survive)} have another number that survives, by up to "
            f"{survive.max()} (by more than six: cells {np.flatnonzero(survive > 6).tolist()}), and "
            f"{np.count_nonzero(settle)} another that settles, by up to {settle.max()}"
        )
    return lines


def period() -> list[str]:
    """Tracking error at a few periods, and the periods that do not settle."""
    table = run_study_file("period")
    draw("period", "total_variation.torque")
    shown = table[table["period"].isin([0.001, 0.01, 0.02, 0.05, 0.07])]
    columns = ["period", "position_rmse", "settling_time", "ultimate_bound", "total_variation.torque"]
    without = quadcosim.run(PAPER.with_changes(parameters=theory.CALM)).metrics["ultimate_bound"]
    return [
        shown[columns].to_string(index=False),
        fates(table),
        *(f"{fate}: not at {listed(table[~has(table)]['period'])}" for fate, has in FATES.items()),
        f"without wind at 10 ms: residual {without:.3g} m",
    ]


def limits() -> list[str]:
    """Limits of the period over kappa."""
    lines = []
    for kappa in KAPPAS:
        paper = PAPER.with_changes(parameters={"controller.coupling": kappa})
        found = limit.find(paper, "period", progress=None, announce=None)
        lines.append(
            f"kappa {kappa:<4g} local {in_ms(found.local_limit)}, settles up to {in_ms(found.large_signal_limit)}, "
            f"again at {found.flies_above}: {found.note}"
        )
        if kappa == 1.0:
            figure.draw_spectral_radius(paper, found, FIGURES, DOCS)
    return lines


def continuous() -> list[str]:
    """The same flights near continuous time, and the settling of those with much coupling."""
    table = run_study_file("continuous")
    lines = [
        f"kappa {flight.coupling:<4g} at {in_ms(flight.period)}: {flight.outcome}, within 5 cm from "
        f"{flight.settling_time:.5g} s, residual {flight.ultimate_bound:.4g} m"
        for flight in table.sort_values(["coupling", "period"], kind="stable").itertuples()
    ]
    return [fates(table), changed_by_halving(table, "coupling", CONTINUOUS), *lines]


def delay() -> list[str]:
    """Limits of the loop with a delay, and with another kappa."""
    lines = []
    for name, by, axis in (("period_delay", "period", "delay"), ("period_coupling", "coupling", "period")):
        table = run_study_file(name)
        draw(name, "position_rmse")
        lines += [name, fates(table), *up_to(table, by, axis)]
    return lines


def gains() -> list[str]:
    """Limits of the period over the gain factor, for three ways of scaling kappa."""
    tables = {label: run_study_file(name) for name, label in GAINS.items()}
    ends = {label: first_ends(table, "gain_factor", "period") for label, table in tables.items()}
    factors = np.array(sorted(set(next(iter(tables.values()))["gain_factor"])))
    local = np.array([about_hover(_uncoupled(factor), "period").limit for factor in factors])
    _save(lambda: charts.gain_limits(factors, ends, local), "gain_limits")
    lines = [f"local limit, kappa = 0: {', '.join(f'{f:g}: {in_ms(one)}' for f, one in zip(factors, local))}"]
    for label, table in tables.items():
        lines += [
            label,
            fates(table),
            *up_to(table, "gain_factor", "period"),
            changed_by_halving(table, "gain_factor", CONTINUOUS),
        ]
    return lines


def finite_time() -> list[str]:
    """Decay of error and energy over the exponent, inside and outside of the boundary layer."""
    table = run_study(theory.decay_study())
    lines, medians = [], []
    for (exponent, period), group in table.groupby(["exponent", "period"], sort=False):
        times = theory.since(group)
        inside, rates = times[:, theory.BOUNDS.index(theory.LAYER)], theory.rates_of(times)
        reached = inside[~np.isnan(inside)]
        low, high = wilson(len(reached), len(inside))
        line = f"beta_t {exponent:<4g} {in_ms(period)}: {len(reached)} of {len(inside)} [{low:.0%}, {high:.0%}] stay "
        line += f"inside 1 mm; largest error of the last 5 s: median {1e3 * group['remains'].median():.3g} mm"
        whole = [median_with_interval(column) for column in rates.T if not np.isnan(column).any()]
        if len(reached) == len(inside):
            line += f"; median from {median_with_interval(reached)} s, paper's from {inside[0]:.4g} s"
        lines += [line, f"    rates: {'; '.join(whole)}; theory {theory.expected_rate(exponent):.3g} 1/s"]
        if period == theory.DECAY_PERIODS[0]:
            medians.append(np.median(rates, axis=0))
    for kappa in (0.0, 1.0):
        loop = HoverLoop.of(PAPER.with_changes(parameters={"controller.coupling": kappa}))
        slowest = [round(-float(np.log(loop.spectral_radius(T, 0.0))) / T, 3) for T in theory.DECAY_PERIODS]
        lines.append(f"hover, kappa {kappa:g}: slowest mode {slowest} 1/s")
    lines.append(f"L_kappa, beta_t 1, 1 ms: rates {[round(rate, 1) for rate in theory.energy_rates()]} 1/s")
    curves = {exponent: theory.error_over_time(exponent)[:2] for exponent in theory.EXPONENTS}
    _save(lambda: charts.decay(curves, np.array(medians)), "decay")
    return lines


def bandwidth() -> list[str]:
    """The gains that set the local limit of the period: exponents, one gain and one loop at a time."""
    lines = []
    for kappa in (0.0, 1.0):
        found = theory.limits_over_gains(kappa)
        for name, values in found.items():
            slope, low, high = theory.exponent_of(theory.FACTORS, values)
            lines.append(f"kappa {kappa:g}, {name}: exponent {slope:.3f} [{low:.3f}, {high:.3f}]; {all_in_ms(values)}")
        if kappa == 0.0:
            _save(lambda found=found: charts.loop_gains(found), "loop_gains")  # type: ignore[misc]
    alone = [theory.of_attitude_alone(15.0 * f, 15.0 * f, 15.0 * f) for f in theory.FACTORS]
    return [*lines, f"attitude loop by itself: {all_in_ms(alone)}"]


def bounds() -> list[str]:
    """Delays that hover tolerates, by theory."""
    found = [margin_of(PAPER.with_changes(timing={"period": T})) for T in theory.MARGIN_PERIODS]
    columns = [np.array([getattr(one, key) for one in found]) for key in
               ("delay_limit", "certain_jitter", "breaking_jitter")]  # fmt: skip
    _save(lambda: charts.margins(*columns), "margins")
    return [
        f"{in_ms(one.period)}: constant {in_ms(one.delay_limit)}, certain {in_ms(one.certain_jitter)}, breaking "
        f"{in_ms(one.breaking_jitter)} by {one.breaking_sequence}"
        for one in found
    ]


def certificates() -> list[str]:
    """Late samples and late commands together: certified values, and values that break hover."""
    slow = PAPER.with_changes(timing={"period": 0.04})
    found = quadcosim.margin_region(slow, "components.controller.sampling.jitter", "connections.command.delay_jitter")
    _save(lambda: found.figure(DOCS), "margin_region")
    return [
        f"{name}: " + ", ".join(f"{in_ms(a)} with {in_ms(b)}" for a, b in pairs)
        for name, pairs in (("certified", found.certified), ("breaking", found.breaking))
    ]


def wind() -> list[str]:
    """The exact costs of a white force about hover over period and delay, compared with runs."""
    costs = theory.costs_of_wind()
    _save(lambda: charts.wind(costs), "wind")
    finite = costs["radius"] < 1.0
    lines = [f"{finite.sum()} of {finite.size} have an end"]
    for name in theory.WIND_COSTS:
        values = costs[name][finite]
        lines.append(f"{name}: {values.min():.6g} to {values.max():.6g}")
    for period, delay in theory.WIND_RUNS:
        for name, squares in theory.squares_in_wind(period, delay).items():
            exact = costs[name][theory.WIND_DELAYS.index(delay), theory.WIND_PERIODS.index(period)]
            found, width = np.sqrt(squares.mean()), 2.13 * squares.std(ddof=1) / np.sqrt(len(squares))
            simulated = f"{len(squares)} runs {found:.4g} +- {width / (2.0 * found):.2g}"
            lines.append(f"{in_ms(period)}, {in_ms(delay)}: {name} {exact:.6g}; {simulated}")
    return lines


def monte_carlo() -> list[str]:
    """How many survive and settle, and rank correlations of the survivors' errors with each axis."""
    table = run_study_file("monte_carlo")
    draw("monte_carlo", "ultimate_bound")
    lines, alive = [fates(table)], survived(table)
    groups = {"all": table}
    for axis, edge in RANDOM.items():
        groups |= {f"{axis} < {edge:g}": table[table[axis] < edge], f"{axis} >= {edge:g}": table[table[axis] >= edge]}
    for name, group in groups.items():
        lines.append(f"{name}: " + "; ".join(f"{fate} {share(has(group))}" for fate, has in FATES.items()))
    for name, group in {
        "survive": table[alive],
        "loss < 0.25": table[alive & (table["loss"] < RANDOM["loss"])],
    }.items():
        for metric in ("ultimate_bound", "position_rmse"):
            median = median_with_interval(group[metric])
            lines.append(f"{name}: median {metric} {median}, rank correlations " + ", ".join(
                f"{axis} {rank_correlation(group[axis], group[metric])}" for axis in RANDOM
            ))  # fmt: skip
    return lines


def sensitivity() -> list[str]:
    """Sobol indices of several designs: of surviving, of settling, and of settling soon."""
    study = load_study(ROOT / "studies" / "sensitivity.toml")
    questions: Mapping[str, Callable[[Any], Any]] = {**FATES, "settle by 6.7 s": lambda table: table[SETTLING] <= 6.7}
    tables = {seed: run_study(_design(study, seed)) for seed in range(DESIGNS)}
    draw("sensitivity", "good")
    lines = [fates(pd.concat(tables.values()))]
    for name, has in questions.items():
        designs = [drawing.indices_of(_design(study, seed), has(table).to_numpy(float), "outcome")
                   for seed, table in tables.items()]  # fmt: skip
        lines.append(f"{name}: shares {[round(float(has(table).mean()), 3) for table in tables.values()]}")
        for several in zip(*designs, strict=True):  # of one kind and axis
            values, widths = np.array([(one.value, one.confidence) for one in several]).T
            mean = values.mean()
            lines.append(
                f"  {several[0].kind:<6} {several[0].axis:<12} {mean:6.3f} +- {widths.max():.3f}; designs "
                f"{np.round(values, 3)}; {(np.abs(values - mean) <= widths).sum()} of {DESIGNS} intervals hold the mean"
            )
    return lines


def agreement() -> list[str]:
    """The agreement of flights in SIMD lanes with the same flights by FMUs, store by store."""
    lines = []
    for path in sorted(RESULTS.glob("*/study.sqlite")):
        with open_for_reading(path) as opened:
            lines.append(f"{path.parent.name}: {LaneAgreement.from_text(opened.about()[AGREEMENT])}")
    return lines


# -- running and drawing ----------------------------------------------------------------------------------


def processor() -> list[str]:
    """The processor share of each design, compared with its performance."""
    _save(processors.figure, "processor")
    return processors.equal_share()


def stalls() -> list[str]:
    """For how long the law may be blocked from the processor."""
    found = processors.stalls()
    _save(lambda: processors.errors(found), "stalls")
    return processors.stall_table(found)


def run_study_file(name: str) -> pd.DataFrame:
    """The table of a study file, after running the missing flights."""
    return run_study(load_study(ROOT / "studies" / f"{name}.toml"))


def run_study(study: Study) -> pd.DataFrame:
    """The table of a study, after running the missing flights in lanes."""
    return sweep(study, folder=RESULTS / study.name, workers=comparisons.WORKERS, engine="batch").to_pandas()


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
