"""Flies the studies of `docs/findings.md`, draws its figures and prints its numbers: run as `make findings`.

Takes some minutes on two cores the first time, and continues where it was if it is stopped.
"""

import json
import sys
from pathlib import Path

import matplotlib
import pandas as pd

from orchestration.scenario import Scenario
from orchestration.studies import drawing, figures, limit
from orchestration.studies.study_file import load_study
from orchestration.studies.sweep import store_path, sweep
from orchestration.studies.table import frame

ROOT = Path(__file__).parent.parent
FIGURES = Path(__file__).parent / "figures"
RESULTS = ROOT / "results" / "findings"
COUPLINGS = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 15.0)


def main() -> None:
    """Everything, in the order of the page."""
    matplotlib.rcParams["savefig.dpi"] = 80
    for name, metric in (
        ("period", "position_rmse"),
        ("period_delay", "position_rmse"),
        ("period_coupling", "position_rmse"),
        ("gains_period", "position_rmse"),
        ("monte_carlo", "position_rmse"),
        ("sensitivity", "position_rmse"),
    ):
        table = fly(name)
        draw(name, metric)
        print(f"\n## {name}\n{SUMMARIES[name](table)}", flush=True)
    print("\n## limits\n" + limits(), flush=True)


def fly(name: str) -> pd.DataFrame:
    """The table of a study, flown as far as it is missing."""
    study = load_study(ROOT / "studies" / f"{name}.toml")
    say = lambda done, total: print(f"\r{name}: {done} of {total}", end="", file=sys.stderr)  # noqa: E731
    sweep(study, folder=RESULTS / name, workers=2, progress=say)
    return frame(store_path(name, RESULTS / name))


def draw(name: str, metric: str) -> None:
    """The figure of a study, into the docs."""
    study = load_study(ROOT / "studies" / f"{name}.toml")
    path = drawing.draw_study(study, RESULTS / name, metric)[-1]  # of two axes, the map
    kind = "_map" if path.stem.endswith("_map") else ""
    (FIGURES / f"study_{name}{kind}.png").write_bytes(path.read_bytes())


def flying_up_to(table: pd.DataFrame, by: str, axis: str) -> str:
    """For each value of one axis, the first end of what flies along the other."""
    lines = []
    for value, group in table.groupby(by):
        ordered = group.sort_values(axis)
        flew = figures.flew(ordered).to_numpy()
        last = (
            "none" if not flew[0] else f"{ordered[axis].to_numpy()[(~flew).argmax() - 1 if not flew.all() else -1]:g}"
        )
        again = " (and again further up)" if not flew.all() and flew[(~flew).argmax() :].any() else ""
        lines.append(f"{by} {value:g}: flies up to {axis} {last}{again}")
    return "\n".join(lines)


def period_summary(table: pd.DataFrame) -> str:
    """Tracking error at a few periods, and what does not fly."""
    shown = table[table["period"].isin([0.001, 0.01, 0.02, 0.05, 0.07])]
    columns = ["period", "position_rmse", "settling_time", "ultimate_bound", "total_variation.torque"]
    fell = table[~figures.flew(table)]["period"]
    return f"{shown[columns].to_string(index=False)}\nnot flying: {', '.join(f'{p:g}' for p in fell) or 'none'}"


def monte_carlo_summary(table: pd.DataFrame) -> str:
    """How many fly, and rank correlations of the error with each axis among those that do."""
    flew = figures.flew(table)
    axes = ["jitter", "loss", "position_noise", "inertia_factor"]
    ranks = table[flew][[*axes, "position_rmse"]].rank().corr()["position_rmse"][axes]
    low = figures.flew(table[table["loss"] < 0.25]).mean()
    high = figures.flew(table[table["loss"] >= 0.25]).mean()
    return (
        f"{int(flew.sum())} of {len(table)} fly; with loss below 0.25 {low:.0%}, above {high:.0%}\n"
        f"median position_rmse of those that fly: {table[flew]['position_rmse'].median():.4f} m\n"
        f"rank correlation with position_rmse:\n{ranks.to_string()}"
    )


def sensitivity_summary(table: pd.DataFrame) -> str:
    """The Sobol indices."""
    study = load_study(ROOT / "studies" / "sensitivity.toml")
    indices = drawing.indices_of(study, table["position_rmse"].to_numpy(float), "position_rmse")
    return "\n".join(f"{i.kind:<6} {i.axis:<12} {i.value:7.3f} +- {i.confidence:.3f}" for i in indices)


SUMMARIES = {
    "period": period_summary,
    "period_delay": lambda table: flying_up_to(table, "period", "delay"),
    "period_coupling": lambda table: flying_up_to(table, "coupling", "period"),
    "gains_period": lambda table: flying_up_to(table, "gain_factor", "period"),
    "monte_carlo": monte_carlo_summary,
    "sensitivity": sensitivity_summary,
}


def limits() -> str:
    """Local and large-signal limits of the period for several couplings, at a plant interval of 2 ms."""
    lines = []
    for coupling in COUPLINGS:
        path = RESULTS / f"limit_{coupling:g}.json"
        scenario = Scenario().with_changes(
            timing={"plant_interval": 0.002}, parameters={"controller.coupling": coupling}
        )  # fmt: skip
        if not path.is_file():
            found = limit.find(scenario, "period")
            path.write_text(json.dumps({"local": found.local_limit, "large": found.large_signal_limit}))
            if coupling == 1.0:
                drawn = drawing.draw_limit(scenario, found, RESULTS)
                (FIGURES / "spectral_radius.png").write_bytes(drawn.read_bytes())
        both = json.loads(path.read_text())
        lines.append(f"coupling {coupling:g}: local {_ms(both['local'])}, large-signal {_ms(both['large'])}")
    return "\n".join(lines)


def _ms(seconds: float | None) -> str:
    return "none" if seconds is None else f"{seconds * 1e3:.1f} ms"


if __name__ == "__main__":
    main()
