"""Draws the figures of README.md and of the pages in this folder: run as `make figures`."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from docs import paper_flight, reference_figures
from docs.pages import fill
from orchestration.experiments.studies.drawing import study_figures
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.sweep import sweep
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.simulation.figures.palette import BLUE, GREEN, GREY, RED
from orchestration.simulation.figures.style import DOCS, save
from orchestration.simulation.runs.draw import draw
from orchestration.systems.schedule.instant_arrays import Cursor
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from quadcosim import run

FIGURES = Path(__file__).parent / "figures"
MILLISECONDS = 1e-6
"""Milliseconds of a nanosecond"""


def main() -> None:
    """Run the flights, write the figures, small enough for a repository, and fill in the statements of the page."""
    flight = run()
    slow = run(Scenario(timing=Timing(period=0.07)))
    limited = run(Scenario(stop_time=4.0).with_changes(parameters={"plant.torque_max": 20.0}))
    lossy = Timing(period=0.02, delay=0.012, jitter=0.006, measurement_loss=0.15, command_loss=0.15)
    figures = {
        **draw(flight, ("path", "errors", "components"), style=DOCS),
        **draw(run(Scenario(stop_time=2.0, timing=lossy)), ("commands",), window=(0.2, 0.8), style=DOCS),
        "overlay": draw((flight, slow), ("components",), window=(0.0, 8.0), style=DOCS)["components"],
        "saturation": draw(limited, ("commands",), window=(0.0, 2.0), style=DOCS)["commands"],
    }
    with DOCS.applied():
        figures["timing"] = timing_diagram()
        figures["references"] = reference_figures.references(DOCS)
        figures["gusts"] = reference_figures.wind(DOCS)
        figures["payload"] = reference_figures.payload(DOCS)
        figures["paper_figure_3"] = paper_flight.figure_3(flight, DOCS)
    figures["study_two_laws"] = two_laws()
    for path in save(figures, FIGURES, DOCS):
        print(path)
    fill(FIGURES.with_name("figures.md"), {"statements": paper_flight.statements(flight)})


def two_laws() -> Figure:
    """The shares of two laws over period and loss, and their difference, of the runs of `studies/two_laws.toml`."""
    study = load_study(FIGURES.parents[1] / "studies" / "two_laws.toml")
    store = sweep(study, workers=2).path
    drawn, _ = study_figures(study, store, None, DOCS)
    return drawn["good_map"]


def timing_diagram() -> Figure:
    """The times of samples and of their commands, from the timetable of a run."""
    cases = (
        ("Gauss-Seidel", Timing(period=0.01)),
        ("Jacobi", Timing(period=0.01, order="jacobi")),
        ("Gauss-Seidel, delay 4 ms", Timing(period=0.01, delay=0.004)),
        ("delay 4 ms, delay jitter 8 ms", Timing(period=0.01, delay=0.004, delay_jitter=0.008)),
        ("jitter 6 ms, command loss 0.3", Timing(period=0.01, jitter=0.006, command_loss=0.3)),
    )
    figure = DOCS.figure(46.0)
    for axes, (title, timing) in zip(figure.subplots(len(cases), 1, sharex=True), cases, strict=True):
        _draw_case(axes, timing)
        axes.set_title(title, loc="left")
    axes.set_xlabel("time [ms]")
    handles, _ = axes.get_legend_handles_labels()
    arrow = Line2D([], [], color=GREEN, marker=">", markersize=5, label="command, until it is applied")
    figure.legend(handles=[*handles, arrow], loc="outside lower center", ncols=4)
    return figure


def _draw_case(axes: Axes, timing: Timing) -> None:
    system, sampled = Scenario(timing=timing, stop_time=0.065, seed=3).as_system(), {}
    for instant in Cursor(Timetable(system, Streams(system.seed, system.streams))).instants():
        now, arrivals = instant.time * MILLISECONDS, [k for _, k, _, _ in instant.arrivals]
        axes.plot(now, 0.0, "|", color=GREY, markersize=4, label="plant point")
        for sample in instant.samples:
            ((_, k, _, arrival),) = sample.sent
            sampled[k] = now
            axes.plot(now, 1.0, "o", color=BLUE, markersize=5, label="sample")
            if arrival < 0:
                axes.plot(now, 0.72, "x", color=RED, markersize=6, label="command lost")
            arrivals += [k] if arrival == instant.time else []
        for k in arrivals:
            arrow = {"arrowstyle": "-|>", "color": GREEN, "shrinkA": 3, "shrinkB": 0}
            axes.annotate("", xy=(now, 0.0), xytext=(sampled[k], 1.0), arrowprops=arrow)
    axes.set(yticks=(0.0, 1.0), yticklabels=("plant", "controller"), ylim=(-0.3, 1.35), xlim=(-1.0, 66.0))
    axes.grid(False)
    axes.spines["left"].set_visible(False)
    _label_once(axes)


def _label_once(axes: Axes) -> None:
    seen = set()
    for line in axes.lines:
        label = str(line.get_label())
        if label in seen:
            line.set_label("_repeated")
        seen.add(label)


if __name__ == "__main__":
    main()
