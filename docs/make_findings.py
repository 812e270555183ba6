"""Flies what is behind `docs/findings`, draws its figures and prints its numbers: run as `make findings`.

`python -m docs.make_findings NAME …` does some sections only, by the names of their functions. It continues where it
was if it is stopped. What it has flown is in `results/findings`.
"""

import dataclasses
import hashlib
import json
import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from docs import charts, comparisons, experiments, theory
from docs.experiments import PAPER
from orchestration.basics.statistics import first_end, quantile, wilson
from orchestration.building.inputs import files_of
from orchestration.figures.style import DOCS, save
from orchestration.flight.hover_loop import HoverLoop
from orchestration.flight.local_limit import about_hover
from orchestration.flight.margin import margin_of
from orchestration.limits import figure, limit
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.wiring import DEFAULT_CONTROLLER, DEFAULT_PLANT
from orchestration.studies import drawing, figures
from orchestration.studies.sensitivity import Index
from orchestration.studies.store import open_for_reading, store_path
from orchestration.studies.study import Study
from orchestration.studies.study_file import load_study
from orchestration.studies.sweep import AGREEMENT, sweep
from orchestration.studies.table import frame
from orchestration.workers.batching import Agreement
from orchestration.workers.executors import RunEvaluator
from orchestration.workers.provenance import versions

ROOT = Path(__file__).parent.parent
FIGURES = Path(__file__).parent / "figures"
RESULTS = ROOT / "results" / "findings"
WORKERS = 2
KAPPAS = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 15.0)
GAINS = {
    "gains_period": "κ = 1 held: its weight 2κ/k_q falls as the gains rise",
    "gains_period_scaled": "κ scaled with the gains: the weight held",
    "gains_period_uncoupled": "κ = 0",
}
MONTE_CARLO = ("jitter", "loss", "position_noise", "inertia_factor")
METRICS = ("outcome", "good", "ultimate_bound", "settling_time")
"""of a flight, that are kept"""
CONTINUOUS = (0.00005, 0.0001)
"""[s], periods that stand for continuous time, if both have the same outcomes"""
DESIGNS, FEW, FEW_DESIGNS = 4, 64, 16
"""Designs of Sobol indices; base samples of smaller ones, for what fewer would have said, and how many such"""
CHECKED = 24
"""flights in lanes that are flown by the FMUs with Python inside as well"""


def main() -> None:
    """Everything, in the order of the page."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()
    sections = (
        compared, period, limits, continuous, starts, delay, bounds, gains, bandwidth, finite_time, monte_carlo,
        sensitivity, agreement, pictures,
    )  # fmt: skip
    for section in [one for one in sections if one.__name__ in sys.argv[1:] or not sys.argv[1:]]:
        print(f"\n## {section.__name__}", flush=True)
        before = _processor_time()
        for line in section():
            print(line, flush=True)
        print(f"{_processor_time() - before:.0f} s of processor time", flush=True)
    print(f"\n{(time.perf_counter() - began) / 60:.1f} min, {_processor_time() / 60:.1f} min of processor time")


def _processor_time() -> float:
    """[s], of this process and of those that it has started and that have ended."""
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


# -- sections ---------------------------------------------------------------------------------------------


def compared() -> list[str]:
    """Controllers from the same starts: limits and cells of every comparison."""
    found = {name: comparisons.fly_all(name) for name in comparisons.NAMES}
    pictures()
    return [line for name, content in found.items() for line in comparisons.lines(name, content)]


def pictures() -> list[str]:
    """Figures of the comparisons from what docs/data keeps of them, without a flight."""
    with DOCS.applied():
        made = dict(comparisons.figures())
    return [str(path) for path in save(made, FIGURES, DOCS)]


def period() -> list[str]:
    """Tracking error at a few periods, and what does not fly."""
    table = fly("period")
    draw("period", "total_variation.torque")
    shown = table[table["period"].isin([0.001, 0.01, 0.02, 0.05, 0.07])]
    columns = ["period", "position_rmse", "settling_time", "ultimate_bound", "total_variation.torque"]
    fell = table[~figures.flew(table)]["period"]
    calm = {f"plant.wind.amplitude.{axis}": 0.0 for axis in "xyz"}
    (without,) = flown("without_wind", [PAPER.with_changes(parameters=calm)])
    return [
        shown[columns].to_string(index=False),
        f"not flying: {', '.join(f'{p:g}' for p in fell) or 'none'}",
        f"without wind at 10 ms: ultimate bound {without['ultimate_bound']:.3g} m",
    ]


def limits() -> list[str]:
    """Limits of the period over kappa."""
    found = limits_of("limits", [experiments.flight(kappa=kappa) for kappa in KAPPAS])
    paper = next(one for kappa, one in zip(KAPPAS, found, strict=True) if kappa == 1.0)
    drawn = figure.draw_spectral_radius(PAPER, limit.Limit(**{**paper, "continuous": None, "tried": ()}), RESULTS, DOCS)
    (FIGURES / "spectral_radius.png").write_bytes(drawn[0].read_bytes())
    return [
        f"kappa {kappa:<4g} local {_ms(one['local_limit'])}, large-signal {_ms(one['large_signal_limit'])}, "
        f"flies above at {one['flies_above']}: {one['note']}"
        for kappa, one in zip(KAPPAS, found, strict=True)
    ]


def continuous() -> list[str]:
    """What the same flights do near continuous time, and when kappa = 5 settles."""
    table = fly("continuous")
    lines = [
        f"kappa {flight.coupling:<4g} at {_ms(flight.period)}: {flight.outcome}, largest error from 20 to 30 s "
        f"{flight.ultimate_bound:.4g} m, below 5 cm from {flight.settling_time:.5g} s"
        for flight in table.sort_values(["coupling", "period"], kind="stable").itertuples()
    ]
    (long,) = flown("kappa_5", [experiments.flight(period=0.001, kappa=5.0, stop_time=120.0)])
    end = f"ultimate bound {long['ultimate_bound']:.3g} m, below 5 cm from {long['settling_time']:.4g} s"
    return [_halving(table, "coupling"), *lines, f"kappa 5 at 1 ms to 120 s: {long['outcome']}, {end}"]


def starts() -> list[str]:
    """Medians of the limit over random starts, by size of the initial error."""
    found = flown("starts", experiments.flights_of_starts())
    flew = np.reshape([one["good"] for one in found], experiments.STARTS)
    _save(lambda: charts.starts(flew), "starts")
    ends = experiments.first_ends(flew)
    lines = []
    for (name, *_), case, all_flew in zip(experiments.CASES, ends, flew, strict=True):
        for size, values, each in zip(experiments.SIZES, case, all_flew, strict=True):
            median, low, high, confidence = quantile(values)
            again = sum(bool(one[round(end / 0.0025) - 1 :].any()) for one, end in zip(each, values, strict=True))
            lines.append(
                f"{name}, {size:g} m: median {_ms(median)} [{_ms(low)}, {_ms(high)}] at {confidence:.1%}, "
                f"lowest {_ms(values.min())}, highest {_ms(values.max())}; none at 5 ms: {int((values == 0).sum())}, "
                f"fly again further up: {again}"
            )
    return lines


def delay() -> list[str]:
    """How far the loop flies with a delay, and with another kappa."""
    lines = []
    for name, by, axis in (("period_delay", "period", "delay"), ("period_coupling", "coupling", "period")):
        table = fly(name)
        draw(name, "position_rmse")
        lines += flying_up_to(table, by, axis)
    return lines


def gains() -> list[str]:
    """First ends of what flies over the gain factor, kappa held in three ways."""
    tables = {name: fly(name) for name in GAINS}
    ends = {label: _first_ends(tables[name], "gain_factor", "period") for name, label in GAINS.items()}
    factors = np.array(sorted(set(tables["gains_period"]["gain_factor"])))
    local = np.array([about_hover(experiments.flight(kappa=0.0, gain_factor=f), "period").limit for f in factors])
    _save(lambda: charts.gain_limits(factors, ends, local), "gain_limits")
    lines = [f"local limit, kappa = 0: {', '.join(f'{f:g}: {_ms(one)}' for f, one in zip(factors, local))}"]
    for name in GAINS:
        lines += [name, *flying_up_to(tables[name], "gain_factor", "period")]
        lines.append(_halving(tables[name], "gain_factor"))
    return lines


def finite_time() -> list[str]:
    """How error and energy decay over the exponent, inside and outside of the boundary layer."""
    flights = theory.decays()
    found = kept("decays", lambda: _in_processes(theory.decay_of, flights), flights)
    shape = (len(theory.EXPONENTS), len(theory.DECAY_PERIODS), theory.DECAY_STARTS + 1)
    inside = np.array([np.nan if one["inside"] is None else one["inside"] for one in found]).reshape(shape)
    remains = np.array([np.nan if one["remains"] is None else one["remains"] for one in found]).reshape(shape)
    rates, energy = (
        np.array([one[kind] for one in found], float).reshape(*shape, len(theory.DECADES))
        for kind in ("rates", "energy_rates")
    )
    lines = []
    for i, exponent in enumerate(theory.EXPONENTS):
        for j, period in enumerate(theory.DECAY_PERIODS):
            reached = inside[i, j][~np.isnan(inside[i, j])]
            low, high = wilson(len(reached), shape[2])
            share = f"{len(reached)} of {shape[2]} [{low:.0%}, {high:.0%}] stay inside 1 mm"
            line = f"beta_t {exponent:<4g} {_ms(period)}: {share}"
            if len(reached) == shape[2]:
                line += f", median from {_interval(reached)} s, paper's start from {inside[i, j, 0]:.4g} s"
            lines.append(f"{line}; largest error of the last 5 s: median {1e3 * np.median(remains[i, j]):.3g} mm")
            for name, of in (("error", rates), ("L", energy)):
                whole = [k for k in range(len(theory.DECADES)) if not np.isnan(of[i, j, :, k]).any()]
                lines.append(f"    rates of {name}: " + "; ".join(_interval(of[i, j, :, k]) for k in whole))
        lines.append(f"    theory, attitude at once: {theory.expected_rate(exponent):.3g} 1/s")
    loop = {kappa: HoverLoop.of(experiments.flight(kappa=kappa)) for kappa in (0.0, 1.0)}
    for kappa, one in loop.items():
        slowest = [round(-float(np.log(one.spectral_radius(T, 0.0))) / T, 3) for T in theory.DECAY_PERIODS]
        lines.append(f"hover, kappa {kappa:g}: slowest mode {slowest} 1/s")
    curves = {
        b: theory.error_over_time(theory.Decay(exponent=b, period=0.001, start=(0.0, 0.0, 0.0)))[:2]
        for b in theory.EXPONENTS
    }
    _save(lambda: charts.decay(curves, np.median(rates, axis=2)), "decay")
    return lines


def bandwidth() -> list[str]:
    """Which gains set the local limit of the period: exponents, one gain and one loop at a time."""
    lines = []
    for kappa in (0.0, 1.0):
        found = kept(f"loop_gains_{kappa:g}", partial(theory.limits_over_gains, kappa), theory.LOOPS, theory.FACTORS)
        limits = {name: np.array(values, float) for name, values in found.items()}
        for name, values in limits.items():
            slope, low, high = theory.exponent_of(theory.FACTORS, values)
            lines.append(f"kappa {kappa:g}, {name}: exponent {slope:.3f} [{low:.3f}, {high:.3f}]; {_all_ms(values)}")
        if kappa == 0.0:
            _save(partial(charts.loop_gains, limits), "loop_gains")
    alone = [theory.of_attitude_alone(15.0 * f, 15.0 * f, 15.0 * f) for f in theory.FACTORS]
    return [*lines, f"attitude loop by itself: {_all_ms(alone)}"]


def bounds() -> list[str]:
    """Delays that hover stands, by theory."""
    scenarios = [theory.NATIVE.with_changes(timing={"period": T}) for T in theory.MARGIN_PERIODS]
    found = kept("margins", lambda: [dataclasses.asdict(one) for one in map(margin_of, scenarios)], scenarios)
    lines = [
        f"{_ms(one['period'])}: constant {_ms(one['delay_limit'])}, certain {_ms(one['certain_jitter'])}, breaking "
        f"{_ms(one['breaking_jitter'])} by {one['breaking_sequence']}"
        for one in found
    ]
    columns = [np.array([one[key] for one in found]) for key in ("delay_limit", "certain_jitter", "breaking_jitter")]
    _save(lambda: charts.margins(*columns), "margins")
    return lines


def monte_carlo() -> list[str]:
    """How many fly, and rank correlations of the ultimate bound with each axis among those that do."""
    table = fly("monte_carlo")
    _save(lambda: charts.monte_carlo(table, MONTE_CARLO), "study_monte_carlo")
    flew = figures.flew(table)
    groups = {"all": flew}
    for axis, edge in (("loss", 0.25), ("jitter", 0.0095), ("position_noise", 0.0017), ("inertia_factor", 1.0)):
        groups |= {f"{axis} < {edge:g}": flew[table[axis] < edge], f"{axis} >= {edge:g}": flew[table[axis] >= edge]}
    lines = [f"{name}: {share_of(group)}" for name, group in groups.items()]
    for metric in ("ultimate_bound", "position_rmse"):
        for axis in MONTE_CARLO:
            value, low, high = _rank_correlation(table[flew][axis], table[flew][metric])
            lines.append(f"rank correlation of {metric} with {axis}: {value:.2f} [{low:.2f}, {high:.2f}]")
        few = table[flew & (table["loss"] < 0.25)]
        value, low, high = _rank_correlation(few["position_noise"], few[metric])
        lines.append(
            f"rank correlation of {metric} with position_noise, loss < 0.25: {value:.2f} [{low:.2f}, {high:.2f}]"
        )
        lines.append(f"median {metric} of those that fly: {table[flew][metric].median():.4f} m")
    counts = table["outcome"].value_counts().to_dict()
    return [*lines, f"outcomes: {counts}"]


def sensitivity() -> list[str]:
    """Sobol indices: several designs of many base samples, and what fewer would have said."""
    study = load_study(ROOT / "studies" / "sensitivity.toml")
    names = [axis.name for axis in study.axes]
    tables, many = designs(study, study.samples, DESIGNS)
    _, few = designs(study, FEW, FEW_DESIGNS)
    fly_of, fell_of = ([round(float(of(table).mean()), 3) for table in tables] for of in (figures.flew, _fell))
    lines = [f"{DESIGNS} designs: fly {fly_of}, diverge {fell_of}"]
    for of in ("outcome", "rank"):
        for kind in ("first", "total"):
            values, widths = _indices(many[of], kind)
            mean = values.mean(axis=0)
            inside = (np.abs(values - mean) <= widths).sum()
            lines.append(f"{of}, {kind}: {inside} of {values.size} intervals hold the mean over the designs")
            for i, name in enumerate(names):
                lines.append(
                    f"  {name:<12} {mean[i]:6.3f}; designs {np.round(values[:, i], 3)} +- {np.round(widths[:, i], 3)}"
                )
            some, spans = _indices(few[of], kind)
            held = (np.abs(some - mean) <= spans).mean()
            lines.append(
                f"  {FEW} base samples: {held:.0%} of {some.size} intervals hold that mean; half-widths "
                f"{np.round(spans.mean(axis=0), 2)}"
            )
    total = [np.stack(_indices(many[of], "total"), axis=-1) for of in ("outcome", "rank")]
    _save(lambda: charts.sobol(names, *total), "study_sensitivity")
    return lines


def designs(study: Study, samples: int, number: int) -> tuple[list[pd.DataFrame], dict[str, list[Any]]]:
    """The tables of some designs of a study, and of each the indices of the outcome and of the rank of the bound."""
    tables: list[pd.DataFrame] = []
    found: dict[str, list[Any]] = {"outcome": [], "rank": []}
    for seed in range(number):
        one = dataclasses.replace(study, samples=samples, design_seed=seed, name=f"{study.name}_{samples}_{seed}")
        table = flown_study(one)
        found["outcome"].append(drawing.indices_of(one, drawing.numbers(table, "outcome"), "outcome"))
        ranks = experiments.ranks(drawing.numbers(table, "ultimate_bound"))
        found["rank"].append(drawing.indices_of(one, ranks, "ultimate_bound"))
        tables.append(table)
    return tables, found


def agreement() -> list[str]:
    """How flights in lanes compare with the same flights by FMUs."""
    chosen = experiments.some_flights(CHECKED)
    alone = [with_python_inside(scenario) for scenario in chosen]
    pairs = zip(_flown(chosen, in_lanes=True), _flown(alone, in_lanes=False), strict=True)
    lines = [f"FMUs with Python inside: {Agreement.of((i, *pair) for i, pair in enumerate(pairs))}"]
    for path in sorted(RESULTS.glob("*/study.sqlite")):
        with open_for_reading(path) as opened:
            about = opened.about()
        if AGREEMENT in about:
            lines.append(f"{path.parent.name}: {Agreement(**json.loads(about[AGREEMENT]))}")
    return lines


def with_python_inside(scenario: Scenario) -> Scenario:
    """The same flight by the FMUs that have Python inside."""
    controller = dataclasses.replace(scenario.controller, fmu=DEFAULT_CONTROLLER)
    return dataclasses.replace(
        scenario, controller=controller, plant=dataclasses.replace(scenario.plant, fmu=DEFAULT_PLANT)
    )


# -- flying -----------------------------------------------------------------------------------------------


def fly(name: str) -> pd.DataFrame:
    """The table of a study file, flown as far as it is missing."""
    return flown_study(load_study(ROOT / "studies" / f"{name}.toml"))


def flown_study(study: Study) -> pd.DataFrame:
    """The table of a study, flown in lanes as far as it is missing."""
    say = lambda done, total: print(f"\r{study.name}: {done} of {total}", end="", file=sys.stderr)  # noqa: E731
    sweep(study, folder=RESULTS / study.name, workers=WORKERS, engine="batch", progress=say)
    print(file=sys.stderr)
    return frame(store_path(study.name, RESULTS / study.name))


def draw(name: str, metric: str) -> None:
    """The figure of a study, into the docs."""
    study = load_study(ROOT / "studies" / f"{name}.toml")
    path = drawing.draw_study(study, RESULTS / name, metric, DOCS)[-1]  # of two axes, the map
    kind = "_map" if path.stem.endswith("_map") else ""
    (FIGURES / f"study_{name}{kind}.png").write_bytes(path.read_bytes())


def kept(name: str, compute: Callable[[], Any], *given: Any) -> Any:
    """What `compute` gave when the sources and what is `given` were what they are, from its file if it is there."""
    path, stamp = RESULTS / f"{name}.json", _stamp(given)
    if path.is_file():
        before = json.loads(path.read_text())
        if before["sources"] == stamp:
            return before["found"]
    found = compute()
    path.write_text(json.dumps({"sources": stamp, "found": found}))
    return json.loads(path.read_text())["found"]


def _stamp(given: Any) -> str:
    """A hash of what flights come from: FMUs, what flies them, what is asked here and beside theory."""
    own = [(ROOT / "docs" / f"{name}.py").read_text(encoding="utf-8") for name in ("experiments", "theory")]
    known = [files_of(PAPER.as_system()).hashes, versions(), own, given]
    return hashlib.sha256(repr(known).encode()).hexdigest()


def flown(name: str, scenarios: list[Scenario]) -> list[dict[str, Any]]:
    """What became of some flights, flown in lanes."""

    def fly_them() -> list[dict[str, Any]]:
        return [{metric: one[metric] for metric in METRICS} for one in _flown(scenarios, in_lanes=True)]

    return list(kept(name, fly_them, scenarios))


def limits_of(name: str, scenarios: list[Scenario]) -> list[dict[str, Any]]:
    """The limits of the period of some scenarios."""
    return list(kept(name, lambda: _in_processes(_limit, scenarios), scenarios))


def _in_processes(function: Callable[[Any], Any], arguments: Any) -> list[Any]:
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        return list(pool.map(function, arguments))


def _flown(scenarios: list[Scenario], *, in_lanes: bool) -> list[Any]:
    systems = [scenario.as_system() for scenario in scenarios]
    with RunEvaluator(files_of(systems[0]), WORKERS) as pool:
        return pool.fly_all(systems, in_lanes=in_lanes)


def _limit(scenario: Scenario) -> dict[str, Any]:
    return dataclasses.asdict(limit.find(scenario, "period"))


# -- words ------------------------------------------------------------------------------------------------


def flying_up_to(table: pd.DataFrame, by: str, axis: str) -> list[str]:
    """For each value of one axis, the first end of what flies along the other, and what flies beyond it."""
    lines = []
    for value, end in zip(sorted(set(table[by])), _first_ends(table, by, axis), strict=True):
        group = table[table[by] == value]
        beyond = group[figures.flew(group) & ~(group[axis] <= end)][axis]
        bounded = group[group["outcome"] == "bounded"][axis]
        lines.append(
            f"{by} {value:g}: flies up to {axis} {end:g}; again at {sorted(beyond)}, bounded at {sorted(bounded)}"
        )
    return lines


def _first_ends(table: pd.DataFrame, by: str, axis: str) -> Any:
    """For each value of `by`, upward, the last value along `axis` before the first that does not fly; nan: none."""
    groups = table.sort_values(axis).groupby(by, sort=True)
    return np.array([first_end(group[axis], figures.flew(group)) for _, group in groups], float)


def _fell(table: pd.DataFrame) -> pd.Series:
    """Which runs diverged."""
    return table["outcome"].eq("diverged")


def _halving(table: pd.DataFrame, by: str) -> str:
    """Which outcomes change where the period that stands for continuous time is halved."""
    fine, coarse = (table[table["period"] == period].set_index(by)["outcome"] for period in CONTINUOUS)
    short, long = map(_ms, CONTINUOUS)
    changed = [f"{value:g}" for value in fine.index if fine[value] != coarse[value]]
    settled = [f"{value:g}" for value in fine.index if fine[value] == "settled"]
    return f"{long} or {short}: outcomes differ at {by} {changed or 'none'}; settled at {settled}"


def share_of(flew: pd.Series) -> str:
    """How many of some runs fly, as a share with its Wilson interval."""
    low, high = wilson(int(flew.sum()), len(flew))
    return f"{int(flew.sum())} of {len(flew)} fly, {flew.mean():.0%} [{low:.0%}, {high:.0%}]"


def _rank_correlation(x: pd.Series, y: pd.Series) -> tuple[float, float, float]:
    """Spearman's, with its 95 % interval by the bootstrap."""
    pairs = np.column_stack([x.to_numpy(float), y.to_numpy(float)])

    def of(rows: Any) -> float:
        return float(pd.DataFrame(rows).rank().corr().to_numpy()[0, 1])

    generator = np.random.default_rng(1)
    resampled = [of(pairs[generator.integers(0, len(pairs), len(pairs))]) for _ in range(1000)]
    return of(pairs), *np.percentile(resampled, [2.5, 97.5])


def _indices(designs: list[list[Index]], kind: str) -> tuple[Any, Any]:
    """Indices and their half-widths, shapes (designs, axes)."""
    rows = [[(one.value, one.confidence) for one in design if one.kind == kind] for design in designs]
    array = np.array(rows)
    return array[..., 0], array[..., 1]


def _save(make: Callable[[], Any], name: str) -> None:
    figures.save(lambda style: make(), FIGURES / name, DOCS)


def _interval(values: Any) -> str:
    """The median of some values, with its interval."""
    median, low, high, _ = quantile(values)
    return f"{median:.3g} [{low:.3g}, {high:.3g}]"


def _all_ms(values: Any) -> str:
    return ", ".join(_ms(value) for value in values)


def _ms(seconds: float | None) -> str:
    return "none" if seconds is None else f"{seconds * 1e3:.4g} ms"


if __name__ == "__main__":
    main()
