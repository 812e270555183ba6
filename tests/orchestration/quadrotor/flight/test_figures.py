"""What figures of runs show: names and units everywhere, equal scales, limits, clipped peaks, the window."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import FillBetweenPolyCollection
from matplotlib.figure import Figure

import quadcosim
from orchestration.quadrotor.flight import commands
from orchestration.quadrotor.flight.commands import welch
from orchestration.quadrotor.flight.names import FIGURES as FLIGHT
from orchestration.quadrotor.flight.path import extent
from orchestration.quadrotor.flight.sliding import surface
from orchestration.simulation.figures import signals
from orchestration.simulation.figures.lines import clip_peaks
from orchestration.simulation.figures.names import COLUMNS
from orchestration.simulation.figures.style import SCREEN, STYLES, Style, save
from orchestration.simulation.runs.draw import draw, labels_of_runs
from orchestration.systems.system.model import Criterion
from quadcosim import Result, UsageError
from tests.extent import in_test_all, sample
from tests.native import native
from tests.places import EXAMPLES

TANK = EXAMPLES / "water_tank" / "system.toml"
NARROW = replace(STYLES["paper"], width=COLUMNS["single"])
WINDOW = (0.3, 0.6)


@pytest.fixture(scope="module")
def flight() -> Result:
    """With torques beyond the limit of the plant."""
    return quadcosim.run(native(stop_time=1.2).with_changes(parameters={"plant.torque_max": 15.0}))


@pytest.fixture(scope="module")
def slow(flight: Result) -> Result:
    return quadcosim.run(flight.request.with_changes(timing={"period": 0.03}))  # type: ignore[attr-defined]


@pytest.fixture(scope="module")
def path(flight: Result) -> Figure:
    """The path of the flight."""
    return draw(flight, ["path"])["path"]


@pytest.fixture(scope="module")
def tank() -> Result:
    return quadcosim.run(quadcosim.load_system(TANK))


def seen(figure: Figure) -> Iterator[Axes]:
    return (axes for axes in figure.axes if axes.get_visible())


def inset(axes: Axes) -> Any:
    found = [child for child in axes.child_axes if child.get_label() == "peak"]
    return found[0] if found else None


# -- names and units --------------------------------------------------------------------------------------


DIMENSIONLESS = ("attitude error", "quaternion", "valve")


def unlabelled(figure: Figure) -> list[str]:
    """Axes along the left and below whose label has no name or no unit."""
    found = []
    for axes in seen(figure):
        place = axes.get_subplotspec()
        assert place is not None
        labels = [axes.get_xlabel()] if place.is_last_row() or axes.get_xlabel() else []
        labels += [axes.get_ylabel()] if place.is_first_col() or axes.get_ylabel() else []
        labels += [axes.get_zlabel()] if axes.name == "3d" else []  # type: ignore[attr-defined]
        named = [len(label) > 4 and "_" not in label for label in labels]
        has_unit = [label.endswith("]") or label.startswith(DIMENSIONLESS) for label in labels]
        found += [label for label, *ok in zip(labels, named, has_unit, strict=True) if not all(ok)]
    return found


@pytest.mark.parametrize("style", sample([SCREEN, NARROW], 1), ids=lambda style: str(style.width))
def test_every_axis_of_every_figure_has_a_name_and_a_unit(style: Style, flight: Result, slow: Result) -> None:
    for results in ([flight], [flight, slow]):
        made = draw(results, style=style)
        assert set(made) == set(FLIGHT)
        assert {name: unlabelled(figure) for name, figure in made.items()} == {name: [] for name in FLIGHT}


def test_signals_of_any_fmus_have_their_descriptions_and_units(tank: Result) -> None:
    figure = draw(tank)["signals"]
    assert unlabelled(figure) == []
    named = [text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()]  # type: ignore[union-attr]
    assert any(": " in name for name in named)
    assert not any("." in name for name in named)


def test_up_is_up_and_axes_have_their_names_in_both_conventions() -> None:
    still = {f"plant.{name}": 0.0 for name in ("initial.quaternion.x", "initial.quaternion.y", "initial.quaternion.z")}
    results = {
        frame: quadcosim.run(
            native(stop_time=0.2).with_changes(
                parameters={"plant.frame": frame, "controller.frame": frame, "plant.initial.quaternion.w": 1.0, **still}
            )
        )
        for frame in ("ned", "enu")
    }
    (ned,), (enu,) = (draw(result, ["path"])["path"].axes for result in results.values())
    for axes, names in ((ned, ("north", "east", "down")), (enu, ("east", "north", "up"))):
        labels = (axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel())  # type: ignore[attr-defined]
        assert labels == tuple(f"{axis}, {name} [m]" for axis, name in zip("xyz", names, strict=True))
    assert ned.zaxis_inverted()  # type: ignore[attr-defined]
    assert not enu.zaxis_inverted()  # type: ignore[attr-defined]


def test_a_system_with_the_variables_of_a_quadrotor_is_drawn_as_a_flight_also_over_one(flight: Result) -> None:
    system = quadcosim.run(flight.request.as_system())
    assert set(draw(system)) == set(draw([flight, system])) == set(FLIGHT)


def test_signals_of_any_system_share_a_panel_by_unit_and_none_is_left_out_up_to_a_number_of_panels(
    flight: Result, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = flight.request.as_system()
    bare = replace(whole, sources={}, objectives={}, optional=(), criterion=Criterion(), operating_point={})
    result = quadcosim.run(replace(bare, stop_time=0.05))
    figure = draw(result)["signals"]
    figure.draw_without_rendering()
    labels = [" ".join(axes.get_ylabel().split()) for axes in figure.axes]
    measured = ("position [m]", "velocity [m/s]", "quaternion", "angular velocity [rad/s]")
    commanded = ("thrust [N]", "torque [N·m]")
    assert labels == [*(f"measurement: {name}" for name in measured), *(f"command: {name}" for name in commanded)]
    assert sum(len(axes.get_lines()) for axes in figure.axes) == sum(len(x.start) for x in whole.connections)
    for axes in figure.axes:
        legend = axes.get_legend()
        assert legend is not None
        assert len(legend.get_texts()) == len(axes.get_lines())
        assert legend.get_window_extent().y0 >= axes.get_window_extent().y1 - 1.0
    left_out = sum(len(axes.get_lines()) for axes in figure.axes[2:])
    monkeypatch.setattr(signals, "MAX_PANELS", 2)
    figure = draw(result)["signals"]
    assert [" ".join(axes.get_ylabel().split()) for axes in figure.axes] == labels[:2]
    assert figure.get_supxlabel() == f"and {left_out} more signals"


def test_a_legend_tells_what_differs_between_runs(flight: Result, slow: Result) -> None:
    heavy = replace(flight, request=flight.request.with_changes(parameters={"plant.mass": 1.2}))  # type: ignore[attr-defined]
    assert labels_of_runs([flight, slow], ["a", "b"]) == ["period 10 ms", "period 30 ms"]
    assert labels_of_runs([flight, heavy], ["a", "b"]) == ["mass 1 kg", "mass 1.2 kg"]
    assert labels_of_runs([flight, flight], ["a", "b"]) == ["a", "b"]
    for name, figure in draw([flight, slow]).items():
        texts = [[text.get_text() for text in legend.get_texts()][-2:] for legend in figure.legends]
        assert ["period 10 ms", "period 30 ms"] in texts, name


def test_runs_of_different_systems_are_not_laid_over_each_other(flight: Result, tank: Result) -> None:
    with pytest.raises(UsageError, match="expected runs of one system"):
        draw([flight, tank])
    with pytest.raises(UsageError, match=r"beauty: expected one of path, errors, .*, or a recorded signal"):
        draw(flight, ["beauty"])
    with pytest.raises(UsageError, match=r"tank.levl: expected .*; did you mean tank.level"):
        draw(tank, ["tank.levl"])


def test_any_recorded_signal_or_vector_is_drawn_by_its_name(flight: Result, slow: Result) -> None:
    figures = draw([flight, slow], ["controller.attitude_error", "plant.thrust"])
    assert [*figures] == ["controller.attitude_error", "plant.thrust"]
    (vector,), (scalar,) = ([*seen(figure)] for figure in figures.values())
    assert len(vector.get_lines()) == 8
    assert (len(scalar.get_lines()), " ".join(scalar.get_ylabel().split())) == (2, "plant: thrust [N]")


@in_test_all
@pytest.mark.filterwarnings("error")
def test_a_flight_that_rests_where_it_should_is_drawn_too(tmp_path: Path) -> None:
    """All its errors are zero, of which there is no logarithm."""
    zero = [f"plant.initial.{what}.{axis}" for what in ("position", "quaternion") for axis in "xyz"]
    zero += [f"plant.wind.amplitude.{axis}" for axis in "xyz"]
    zero += [f"controller.trajectory.{what}" for what in ("amplitude_x", "amplitude_y", "start_z", "rate_z")]
    still = native(stop_time=0.1).with_changes(
        parameters={**dict.fromkeys(zero, 0.0), "plant.initial.quaternion.w": 1.0}
    )
    made = draw(quadcosim.run(still))
    assert {path.stem for path in save(made, tmp_path, replace(SCREEN, dpi=40.0, formats=("png",)))} == set(FLIGHT)
    assert made["errors"].axes[0].get_yscale() == "linear"


# -- the path ---------------------------------------------------------------------------------------------


def test_a_metre_is_as_long_along_each_axis_of_the_path(path: Figure) -> None:
    axes: Any = path.axes[0]
    spans = np.array([abs(np.subtract(*limits)) for limits in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())])
    scales = np.array(axes.get_box_aspect()) / spans
    assert scales == pytest.approx(scales[0])


@pytest.mark.parametrize("style", [SCREEN, NARROW, STYLES["slides"]])
def test_the_path_fills_its_figure_and_hides_nothing_of_it(flight: Result, style: Style) -> None:
    figure = draw(flight, ["path"], style=style)["path"]
    figure.draw_without_rendering()
    axes: Any = figure.axes[0]
    seen = extent(axes)
    (legend,) = figure.legends
    width, height = figure.get_size_inches() * figure.dpi
    assert seen.x0 > 0.0
    assert seen.x1 < width
    assert legend.get_window_extent().y1 < seen.y0 < seen.y1 < height
    assert max(seen.width / width, (seen.height + legend.get_window_extent().y1) / height) > 0.9


def test_the_path_shows_reference_start_and_end(path: Figure) -> None:
    axes: Any = path.axes[0]
    lines = {line.get_label(): np.transpose(line.get_data_3d()) for line in axes.get_lines()}
    assert lines["start"][0].tolist() == lines["flown"][0].tolist()
    assert lines["end"][0].tolist() == lines["flown"][-1].tolist()
    assert lines["reference"][0].tolist() == [0.0, 0.0, 2.0]


# -- the window -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["errors", "components", "energy"])
def test_figures_over_time_are_zoomed_on_the_window(name: str, flight: Result, slow: Result) -> None:
    for results in ([flight], [flight, slow]):
        figure = draw(results, [name], window=WINDOW)[name]
        assert {axes.get_xlim() for axes in seen(figure)} == {WINDOW}


def test_commands_and_signals_are_zoomed_on_the_window(flight: Result, tank: Result) -> None:
    whole, zoom, *_ = draw(flight, ["commands"], window=WINDOW)["commands"].axes
    assert (whole.get_xlim(), zoom.get_xlim()) == ((0.0, 1.2), WINDOW)
    assert {axes.get_xlim() for axes in draw(flight, ["commands"], window=WINDOW, style=NARROW)["commands"].axes} == {
        WINDOW
    }
    assert {axes.get_xlim() for axes in draw(tank, window=(1.0, 2.0))["signals"].axes} == {(1.0, 2.0)}


def test_path_and_phase_show_the_window_alone(flight: Result) -> None:
    made = draw(flight, ["path", "phase"], window=WINDOW)
    inside = (flight.signals["time"] >= WINDOW[0] - 1e-3 - 1e-9) & (flight.signals["time"] <= WINDOW[1] + 1e-3 + 1e-9)
    for axes, label, column in (
        (made["path"].axes[0], "flown", "plant.position.x"),
        (made["phase"].axes[0], "flown", "controller.position_error.x"),
    ):
        (line,) = [one for one in axes.get_lines() if one.get_label() == label]
        drawn: Any = line.get_data_3d()[0] if axes.name == "3d" else line.get_xdata()  # type: ignore[attr-defined]
        expected = flight.signals[column][inside]
        assert len(expected) - 1 <= len(drawn) <= len(expected)
        assert set(np.asarray(drawn)) <= set(expected)


def test_the_spectrum_is_of_the_window_alone(flight: Result) -> None:
    lowest = [draw(flight, ["spectrum"], window=w)["spectrum"].axes[0].get_xlim()[0] for w in (None, (0.3, 0.4))]
    assert lowest[0] < lowest[1]


# -- peaks, limits, surfaces ------------------------------------------------------------------------------


def test_errors_that_are_flat_for_four_fifths_are_cut_there_unless_a_window_is_given() -> None:
    whole = quadcosim.run(native(stop_time=32.0))
    for window, end in ((None, 7.0), ((0.0, 32.0), 32.0)):
        figure = draw(whole, ["components"], window=window)["components"]
        assert {axes.get_xlim() for axes in seen(figure)} == {(0.0, end)}
        assert ("flat from there to 32 s" in figure.legends[0].get_title().get_text()) is (window is None)


def test_a_clipped_peak_is_noted_and_shown_in_an_inset(flight: Result) -> None:
    t = np.linspace(0.0, 10.0, 2001)
    peaked, calm = 0.5 * np.sin(t) - 100.0 * np.exp(-20.0 * t), np.sin(t) + 1.0
    noisy = 0.5 * np.sin(t) - 100.0 * (np.arange(len(t)) % 200 == 100)  # an inset would have the whole time
    for values, clips in ((peaked, True), (calm, False), (noisy, False)):
        axes = Figure().add_subplot()
        axes.plot(t, values)
        axes.set_xlim(0.0, 10.0)
        assert clip_peaks(axes, [(t, values)], "N.m", SCREEN) is clips
        shown = inset(axes)
        assert (shown is not None) is clips
        if shown is not None:
            assert axes.get_ylim()[0] > -10.0, "-100 is not on it"
            assert shown.get_title() == "clipped: peak −100 N·m at 0 s"
            assert shown.get_ylim()[0] < -100.0
            assert shown.get_xlim()[1] < 1.0
    axes = Figure().add_subplot()
    axes.plot(t, peaked)
    axes.set_xlim(0.0, 10.0)
    assert clip_peaks(axes, [(t, peaked)], "N.m", SCREEN, beside=(0.0, 1.0)), "the panel beside it shows the peak"
    assert inset(axes) is None
    assert [text.get_text() for text in axes.texts] == ["clipped: peak −100 N·m at 0 s"]


def shaded(axes: Axes) -> Sequence[FillBetweenPolyCollection]:
    return [one for one in axes.collections if one.get_label() == commands.AT_LIMIT]  # type: ignore[misc]


def test_the_time_at_a_limit_of_the_plant_is_marked_and_no_other(flight: Result) -> None:
    figure = draw(flight, ["commands"], window=(0.0, 1.2))["commands"]
    thrust, torque = figure.axes[1], figure.axes[5]
    assert not shaded(thrust)
    (marked,) = shaded(torque)
    t, torque_y = flight.signals["time"], flight.signals["plant.torque.y"]
    held = np.diff(t, append=t[-1])
    ends = [path.get_extents() for path in marked.get_paths()]
    assert sum(end.width for end in ends) == pytest.approx(held[np.abs(torque_y) > 15.0].sum(), abs=2e-3)
    limits = {float(line.get_ydata()[0]) for line in torque.get_lines() if line.get_label() == "limit of the plant"}  # type: ignore[index,arg-type]
    assert limits == {15.0, -15.0}
    assert commands.AT_LIMIT in [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_sliding_surface_of_the_portrait_is_where_s_of_the_law_is_0(flight: Result) -> None:
    e = np.array([-0.5, -1e-4, 0.0, 1e-4, 0.5])
    assert surface(e, flight.parameters) == pytest.approx([5 * 0.5**0.99, 5e-4, 0.0, -5e-4, -5 * 0.5**0.99])
    assert surface(e, {}) is None
    error, rate, s = (
        flight.signals[f"controller.{name}"] for name in ("position_error.z", "velocity_error.z", "sliding.z")
    )
    on_surface = surface(error, flight.parameters)
    assert on_surface is not None
    assert rate - on_surface == pytest.approx(s, abs=1e-12)


def test_a_spectrum_has_the_power_of_the_signal_at_its_frequency() -> None:
    t = 0.001 * np.arange(4096)
    frequency, density = welch(np.column_stack([3.0 * np.sin(2.0 * np.pi * 62.5 * t), 0.0 * t]), 0.001)
    assert frequency[density[:, 0].argmax()] == pytest.approx(62.5, abs=1.0)
    assert density[:, 0].sum() * frequency[1] == pytest.approx(4.5, rel=1e-3), "mean square: A²/2"
    assert not density[:, 1].any()


def test_the_spectrum_marks_the_rate_at_which_the_controller_samples(slow: Result) -> None:
    for axes in draw(slow, ["spectrum"])["spectrum"].axes:
        rates = [line.get_xdata()[0] for line in axes.get_lines() if line.get_label() == "_rate"]  # type: ignore[index]
        assert rates == pytest.approx([1.0 / 0.03, 0.5 / 0.03])
        assert any(text.get_text().startswith("sampled at 33.3") for text in axes.texts)


@pytest.mark.usefixtures("blank_figures")
def test_the_spectrum_marks_the_rate_of_what_sends_the_command_by_any_name(slow: Result, tmp_path: Path) -> None:
    system = replace(slow.request.as_system(), objectives={}, optional=(), criterion=Criterion(), operating_point={})
    quadcosim.save_run(quadcosim.run(replace(system, stop_time=0.2)), tmp_path)
    renamed = tmp_path / "renamed.toml"
    renamed.write_text((tmp_path / "scenario.toml").read_text().replace("controller", "law"))
    for axes in draw(quadcosim.run(renamed), ["spectrum"])["spectrum"].axes:
        rates = [line.get_xdata()[0] for line in axes.get_lines() if line.get_label() == "_rate"]  # type: ignore[index]
        assert rates == pytest.approx([1.0 / 0.03, 0.5 / 0.03])
