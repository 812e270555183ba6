"""Flies what is behind `docs/findings.md`, draws its figures and prints its numbers: run as `make findings`.

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
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd

from docs import batch, charts, experiments, theory
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.translation import system_of
from orchestration.statistics import quantile, wilson
from orchestration.studies import drawing, figures, limit
from orchestration.studies.engine import Pool
from orchestration.studies.files import files_of
from orchestration.studies.linear import HoverLoop
from orchestration.studies.local import about_hover
from orchestration.studies.margin import margin_of
from orchestration.studies.study_file import load_study
from orchestration.studies.sweep import store_path, sweep
from orchestration.studies.table import frame

ROOT = Path(__file__).parent.parent
FIGURES = Path(__file__).parent / "figures"
RESULTS = ROOT / "results" / "findings"
WORKERS = 2
PAPER = Scenario().with_changes(timing={"plant_interval": 0.005}, parameters={"plant.max_internal_step": 0.005})
KAPPAS = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 15.0)
GAINS = {
    "gains_period": "κ = 1 held: its weight 2κ/k_q falls as the gains rise",
    "gains_period_scaled": "κ scaled with the gains: the weight held",
    "gains_period_uncoupled": "κ = 0",
}
MONTE_CARLO = ("jitter", "loss", "position_noise", "inertia_factor")
CHECKED = 24
"""flights of the batches that are flown as FMUs as well"""


def main() -> None:
    """Everything, in the order of the page."""
    matplotlib.rcParams["savefig.dpi"] = 80
    RESULTS.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()
    sections = (
        period, limits, starts, delay, bounds, gains, bandwidth, finite_time, monte_carlo, sensitivity, agreement,
    )  # fmt: skip
    for section in [one for one in sections if one.__name__ in sys.argv[1:] or not sys.argv[1:]]:
        print(f"\n## {section.__name__}", flush=True)
        for line in section():
            print(line, flush=True)
    used = sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(f"\n{(time.perf_counter() - began) / 60:.1f} min, {used / 60:.1f} min of processor time")


# -- sections ---------------------------------------------------------------------------------------------


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
    """Limits of the period over kappa, and what the same flights do in continuous time."""
    found = limits_of("limits", [_sampled(kappa, 0.01, 30.0) for kappa in KAPPAS])
    lines = [
        f"kappa {kappa:<4g} local {_ms(one['local_limit'])}, large-signal {_ms(one['large_signal_limit'])}, "
        f"flies above at {one['flies_above']}: {one['note']}"
        for kappa, one in zip(KAPPAS, found, strict=True)
    ]
    paper = next(one for kappa, one in zip(KAPPAS, found, strict=True) if kappa == 1.0)
    drawn = drawing.draw_limit(PAPER, limit.Limit(**{**paper, "continuous": None, "tried": ()}), RESULTS)
    (FIGURES / "spectral_radius.png").write_bytes(drawn.read_bytes())
    (ideal,) = kept("continuous", lambda: list(_listed({"30": experiments.continuous()}).values()))
    for i, kappa in enumerate(experiments.CONTINUOUS_KAPPAS):
        lines.append(
            f"continuous, kappa {kappa:<4g}: diverged {ideal['diverged'][i]}, largest error from 20 to 30 s "
            f"{ideal['ultimate_bound'][i]:.4g} m, below 5 cm from {ideal['settling_time'][i]:.4g} s"
        )
    chosen = ((5.0, 0.001, 120.0), (2.93, 0.001, 30.0), (2.94, 0.001, 30.0), (2.94, 0.00005, 30.0))
    slow = flown("slow", [_sampled(kappa, T, stop) for kappa, T, stop in chosen])
    for (kappa, T, stop), one in zip(chosen, slow, strict=True):
        lines.append(
            f"kappa {kappa:g} at {_ms(T)} to {stop:g} s: {one['outcome']}, ultimate bound {one['ultimate_bound']} m, "
            f"below 5 cm from {one['settling_time']} s"
        )
    return lines


def starts() -> list[str]:
    """Medians of the limit over random starts, by size of the initial error."""
    flew = np.array(kept("starts", lambda: experiments.starts_flown().tolist()))
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
    local = np.array(kept("gains_local", lambda: [_local(factor) for factor in factors], factors.tolist()))
    _save(lambda: charts.gain_limits(factors, ends, local, 0.005), "gain_limits")
    lines = [f"local limit, kappa = 0: {', '.join(f'{f:g}: {_ms(one)}' for f, one in zip(factors, local))}"]
    for name in GAINS:
        lines += [name, *flying_up_to(tables[name], "gain_factor", "period")]
    ideal = kept("continuous_gains", lambda: _listed(experiments.continuous_gains(factors.tolist())), factors.tolist())
    for held, one in ideal.items():
        lines.append(f"continuous, kappa {held}: largest error from 20 to 30 s {np.round(one['ultimate_bound'], 4)} m")
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
    loop = {kappa: HoverLoop.of(_sampled(kappa, 0.01, 30.0)) for kappa in (0.0, 1.0)}
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
        found = kept(f"loop_gains_{kappa:g}", lambda k=kappa: theory.limits_over_gains(k), theory.LOOPS, theory.FACTORS)
        limits = {name: np.array(values, float) for name, values in found.items()}
        for name, values in limits.items():
            slope, low, high = theory.exponent_of(theory.FACTORS, values)
            lines.append(f"kappa {kappa:g}, {name}: exponent {slope:.3f} [{low:.3f}, {high:.3f}]; {_all_ms(values)}")
        if kappa == 0.0:
            _save(lambda limits=limits: charts.loop_gains(limits), "loop_gains")
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
    many = kept("sobol_many", lambda: _designs(experiments.SAMPLES, experiments.DESIGNS))
    few = kept("sobol_few", lambda: _designs(experiments.FEW, experiments.FEW_DESIGNS))
    lines = [f"{experiments.DESIGNS} designs: fly {[round(d['flies'], 3) for d in many]}, "
             f"diverge {[round(d['diverged'], 3) for d in many]}"]  # fmt: skip
    for of in ("outcome", "rank"):
        for kind in ("first", "total"):
            values, widths = _table(many, of, kind)
            mean = values.mean(axis=0)
            inside = (np.abs(values - mean) <= widths).sum()
            lines.append(f"{of}, {kind}: {inside} of {values.size} intervals hold the mean over the designs")
            for i, name in enumerate(names):
                lines.append(
                    f"  {name:<12} {mean[i]:6.3f}; designs {np.round(values[:, i], 3)} +- {np.round(widths[:, i], 3)}"
                )
            some, spans = _table(few, of, kind)
            held = (np.abs(some - mean) <= spans).mean()
            lines.append(
                f"  {experiments.FEW} base samples: {held:.0%} of {some.size} intervals hold that mean; half-widths "
                f"{np.round(spans.mean(axis=0), 2)}"
            )
    total = [np.stack(_table(many, of, "total"), axis=-1) for of in ("outcome", "rank")]
    _save(lambda: charts.sobol(names, *total), "study_sensitivity")
    return lines


def agreement() -> list[str]:
    """Some flights of the batches flown again as FMUs."""
    chosen = experiments.some_flights(CHECKED)
    batched = batch.fly(batch.Flights(**chosen))
    checked = flown("agreement", [as_scenario(chosen, i) for i in range(CHECKED)])
    same = sum(
        (one["outcome"] == "settled") == batched.flies[i] and (one["outcome"] == "diverged") == batched.diverged[i]
        for i, one in enumerate(checked)
    )
    differing = [abs(one["ultimate_bound"] / batched.ultimate_bound[i] - 1.0) for i, one in enumerate(checked)
                 if one["outcome"] == "settled"]  # fmt: skip
    return [f"{same} of {CHECKED} outcomes are the same; ultimate bounds of the {len(differing)} that fly differ by up "
            f"to {max(differing):.1e} of their value"]  # fmt: skip


# -- flying -----------------------------------------------------------------------------------------------


def fly(name: str) -> pd.DataFrame:
    """The table of a study, flown as far as it is missing."""
    study = load_study(ROOT / "studies" / f"{name}.toml")
    say = lambda done, total: print(f"\r{name}: {done} of {total}", end="", file=sys.stderr)  # noqa: E731
    sweep(study, folder=RESULTS / name, workers=WORKERS, progress=say)
    return frame(store_path(name, RESULTS / name))


def draw(name: str, metric: str) -> None:
    """The figure of a study, into the docs."""
    study = load_study(ROOT / "studies" / f"{name}.toml")
    path = drawing.draw_study(study, RESULTS / name, metric)[-1]  # of two axes, the map
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
    """A hash of what the flights come from."""
    files = [ROOT / "studies" / "sensitivity.toml"]
    for folder in ("controller_fmu", "plant_fmu", "fmu_kit"):
        files += sorted((ROOT / folder).glob("*.py"))
    files += [ROOT / "docs" / f"{name}.py" for name in ("batch", "experiments", "theory")]
    return hashlib.sha256(b"".join([*(file.read_bytes() for file in files), repr(given).encode()])).hexdigest()


def flown(name: str, scenarios: list[Scenario]) -> list[dict[str, Any]]:
    """The metrics of some flights."""
    return list(kept(name, lambda: _flown(scenarios), scenarios))


def limits_of(name: str, scenarios: list[Scenario]) -> list[dict[str, Any]]:
    """The limits of the period of some scenarios."""
    return list(kept(name, lambda: _in_processes(_limit, scenarios), scenarios))


def _in_processes(function: Callable[[Any], Any], arguments: Any) -> list[Any]:
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        return list(pool.map(function, arguments))


def _flown(scenarios: list[Scenario]) -> list[Any]:
    with Pool(files_of(system_of(PAPER)), WORKERS) as pool:
        return pool.fly(list(map(system_of, scenarios)), stop=lambda metrics: False)


def _limit(scenario: Scenario) -> dict[str, Any]:
    return dataclasses.asdict(limit.find(scenario, "period"))


def _sampled(kappa: float, period: float, stop_time: float) -> Scenario:
    return PAPER.with_changes(
        timing={"period": period}, parameters={"controller.coupling": kappa}, stop_time=stop_time
    )  # fmt: skip


def _local(factor: float) -> float | None:
    """The local limit without coupling, the attitude gains times a factor."""
    return about_hover(_geared(factor, 0.0), "period").limit


def _geared(factor: float, kappa: float) -> Scenario:
    """The paper's flight with its attitude gains times a factor."""
    scaled = {f"controller.gain.{name}": 15.0 * factor for name in ("eta", "theta", "attitude")}
    return PAPER.with_changes(parameters={**scaled, "controller.coupling": kappa})


def as_scenario(flights: dict[str, Any], i: int) -> Scenario:
    """One of some flights of a batch, for the FMUs."""
    chosen = {name: float(flights[name][i]) for name in ("period", "delay", "kappa", "gain_factor", "surface", "lag")}
    return PAPER.with_changes(
        timing={"period": chosen["period"], "delay": chosen["delay"]},
        parameters={
            "controller.coupling": chosen["kappa"],
            "controller.gain.surface": chosen["surface"],
            **{f"controller.gain.{name}": 15.0 * chosen["gain_factor"] for name in ("eta", "theta", "attitude")},
            **{f"plant.initial.position.{axis}": float(p[i]) for axis, p in zip("xyz", flights["start"], strict=True)},
            "plant.actuator_time_constant": chosen["lag"],
        },
    )


def _designs(samples: int, number: int) -> list[dict[str, Any]]:
    study = load_study(ROOT / "studies" / "sensitivity.toml")
    return [dataclasses.asdict(design) for design in experiments.sobol_designs(study, samples, range(number))]


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
    ends = []
    for _, group in table.groupby(by, sort=True):
        ordered = group.sort_values(axis)
        flew, along = figures.flew(ordered).to_numpy(), ordered[axis].to_numpy(float)
        first = len(flew) if flew.all() else int((~flew).argmax())
        ends.append(along[first - 1] if first else np.nan)
    return np.array(ends)


def share_of(flew: pd.Series) -> str:
    """How many of some runs fly, as a share with its Wilson interval."""
    low, high = wilson(int(flew.sum()), len(flew))
    return f"{int(flew.sum())} of {len(flew)} fly, {flew.mean():.0%} [{low:.0%}, {high:.0%}]"


def _rank_correlation(x: pd.Series, y: pd.Series) -> tuple[float, float, float]:
    """Spearman's, with its 95 % interval by the bootstrap."""
    pairs = np.column_stack([x.to_numpy(float), y.to_numpy(float)])
    of = lambda rows: float(pd.DataFrame(rows).rank().corr().to_numpy()[0, 1])  # noqa: E731
    generator = np.random.default_rng(1)
    resampled = [of(pairs[generator.integers(0, len(pairs), len(pairs))]) for _ in range(1000)]
    return of(pairs), *np.percentile(resampled, [2.5, 97.5])


def _table(designs: list[dict[str, Any]], of: str, kind: str) -> tuple[Any, Any]:
    """Indices and their half-widths, shapes (designs, axes)."""
    rows = [[(one["value"], one["confidence"]) for one in design[of] if one["kind"] == kind] for design in designs]
    array = np.array(rows)
    return array[..., 0], array[..., 1]


def _listed(outcomes: dict[str, batch.Outcomes]) -> dict[str, dict[str, list[float]]]:
    return {
        horizon: {name: np.asarray(values).tolist() for name, values in vars(found).items()}
        for horizon, found in outcomes.items()
    }


def _save(make: Callable[[], Any], name: str) -> None:
    figures.save(make, FIGURES / f"{name}.png")


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
