"""The page in a browser: what is drawn, what keys and clicks do, and that nothing is asked of a network."""

import dataclasses
import io
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from fmu_kit.algebra import Quaternion
from fmu_kit.frames import attitude
from orchestration.experiments.comparison.file import load_comparison
from orchestration.experiments.comparison.run import compare
from orchestration.experiments.report.writing import report
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.flight.layout import ATTITUDE, DESIRED, PLACE
from orchestration.quadrotor.scenarios.wiring import POSITION_REFERENCE
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.file import load_system
from orchestration.systems.system.paths import changed
from quadcosim import Scenario, Timing
from tests.extent import in_test_all
from tests.native import NATIVE
from tests.orchestration.experiments.studies.common import axis, sweep
from tests.patience import PATIENCE
from tests.places import EXAMPLES

Show = Callable[[Path], Any]


@pytest.fixture(scope="module")
def show(browser: Any) -> Iterator[Show]:
    """Opens a file and waits until it is drawn; in the end nothing was complained of and nothing was loaded."""
    told: list[str] = []
    asked: list[str] = []

    def open_page(file: Path) -> Any:
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.set_default_timeout(1e3 * PATIENCE)
        page.on("console", lambda message: told.append(message.text))
        page.on("pageerror", lambda error: told.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(file.as_uri())
        page.wait_for_selector("body[data-drawn]")
        return page

    yield open_page
    assert told == []
    assert [url for url in asked if not url.startswith("file:")] == []


def scenario(**timing: Any) -> Scenario:
    return dataclasses.replace(NATIVE, stop_time=2.0, timing=Timing(plant_interval=0.005, **timing))


@pytest.fixture(scope="module")
def of_runs(show: Show, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Two runs: one so long that its peaks at the start are short, and one that diverges."""
    folder = tmp_path_factory.mktemp("runs")
    long = dataclasses.replace(scenario(), stop_time=12.0)
    return show(report(run(long), run(scenario(period=0.2)), out=folder / "report.html"))


@in_test_all
def test_who_has_a_computer_is_drawn_over_the_same_time_as_the_signals(show: Show, tmp_path: Path) -> None:
    system = changed(load_system(EXAMPLES / "autopilot" / "flight.toml"), {"stop_time": 0.3})
    page = show(report(run(system), out=tmp_path / "report.html"))
    drawn = page.evaluate(
        "document.getElementById('time-plot').data.filter((one) => /^(autopilot|bus)/.test(one.name))"
        ".map((one) => [one.name, one.x.length, one.x[0], one.x.at(-2), one.xaxis ?? 'x'])"
    )
    assert [name for name, *_ in drawn] == [
        *(f"autopilot.{task}" for task in ("storage", "radio", "estimator", "control", "telemetry")),
        *(f"bus.{message}" for message in ("command", "airspeed", "status")),
    ]
    _, points, begin, end, axis = drawn[0]
    assert (points, axis) == (6, "x"), "the switch and the job, and a gap after each"
    assert (begin, end) == (pytest.approx(0.0021), pytest.approx(0.007102))
    page.close()


@pytest.fixture(scope="module")
def of_study(show: Show, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A grid of four runs, of which three have their signals in the file."""
    folder = tmp_path_factory.mktemp("study")
    name = "grid"
    study = Study(name=name, base=scenario(), axes=(axis("timing.period", 0.01, 0.2), axis("timing.delay", 0.0, 0.01)))
    sweep(study, out=folder)
    file = folder / "study.toml"
    fmus = f'[base.plant]\nfmu = "{NATIVE.plant.fmu}"\n[base.controller]\nfmu = "{NATIVE.controller.fmu}"\n'
    axes = "".join(
        f'[[axes]]\nname = "timing.{key}"\nvalues = {values}\n'
        for key, values in (("period", [0.01, 0.2]), ("delay", [0.0, 0.01]))
    )
    file.write_text(
        f'name = "{name}"\n[base]\nstop_time = 2.0\n[base.timing]\nplant_interval = 0.005\n{fmus}{axes}',
        encoding="utf-8",
    )
    return show(report(file, out=folder, flights=3, runs=[0, 1, 2]))


@pytest.fixture(scope="module")
def of_comparison(show: Show, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Two cells of three initial conditions each, of which two have their signals in the file."""
    folder = tmp_path_factory.mktemp("comparison")
    file = folder / "comparison.toml"
    file.write_text(
        f'''name = "two"
[base]
stop_time = 0.5
plant = {{ fmu = "{NATIVE.plant.fmu}" }}
controller = {{ fmu = "{NATIVE.controller.fmu}" }}
timing = {{ plant_interval = 0.005 }}
[[controllers]]
name = "own"
[axis]
name = "period"
sets = ["timing.period"]
values = [0.01, 0.02]
[starts]
count = 3
''',
        encoding="utf-8",
    )
    compare(load_comparison(file), out=folder, figures=False, progress=None, announce=None)
    return show(report(file, out=folder, flights=4))


def wait_for(page: Any, condition: str) -> None:
    """Wait until an expression holds; Playwright's own way needs `eval`, which the page forbids itself."""
    for _ in range(round(20 * PATIENCE)):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    raise AssertionError(condition)


def clock(page: Any) -> float:
    return float(page.inner_text("#player output").split()[0])


def title(page: Any) -> str:
    text: str = page.inner_text("#run-title")
    return text


def test_play_moves_the_vehicle_and_pause_stops_it(of_runs: Any) -> None:
    picture = "document.getElementById('scene').toDataURL()"
    before, numbers = of_runs.evaluate(picture), of_runs.inner_text("#readout")
    of_runs.get_by_role("button", name="Play").click()
    wait_for(of_runs, "parseFloat(document.querySelector('#player output').textContent) > 0.1")
    of_runs.get_by_role("button", name="Pause").click()
    stopped = clock(of_runs)
    assert of_runs.evaluate(picture) != before
    assert of_runs.inner_text("#readout") != numbers
    of_runs.wait_for_timeout(100)
    assert clock(of_runs) == stopped


def test_the_arrow_keys_on_the_time_slider_move_the_replay(of_runs: Any) -> None:
    slider = of_runs.get_by_label("Time", exact=True)
    slider.fill("1")
    before = clock(of_runs)
    slider.press("ArrowRight")
    assert before == 1.0
    assert clock(of_runs) > before
    assert of_runs.inner_text("#readout").startswith("north, east, down ")


def test_the_arrow_keys_on_the_slider_over_runs_open_the_next_one(of_runs: Any) -> None:
    assert "run 1" in title(of_runs)
    of_runs.get_by_label("Runs", exact=True).press("ArrowRight")
    assert "run 2" in title(of_runs)
    assert "▼ diverged" in title(of_runs)
    of_runs.get_by_label("Runs", exact=True).press("ArrowLeft")
    assert "run 1" in title(of_runs)


def test_another_run_is_beside_the_open_one_and_never_itself(of_runs: Any) -> None:
    def offered() -> list[str]:
        found: list[str] = of_runs.get_by_label("Beside it").locator("option").all_text_contents()
        return found

    def beside() -> str:
        label: str = of_runs.locator("#scene-key").inner_text()
        return label

    assert offered() == ["none", "run 2"]
    assert "run 2" in beside()
    of_runs.get_by_label("Runs", exact=True).press("ArrowRight")
    assert offered() == ["none", "run 1"]
    assert "run 1" in beside()
    of_runs.get_by_label("Runs", exact=True).press("ArrowLeft")


def test_the_replay_shows_thrust_and_the_attitude_that_the_vehicle_should_have(of_runs: Any, of_study: Any) -> None:
    for page in (of_runs, of_study):
        key = page.locator("#scene-key").inner_text()
        assert "reference, outlined: now" in key
        assert "thrust" in key
    assert "; thrust " in of_runs.inner_text("#readout")
    lines = of_runs.evaluate("document.getElementById('time-plot').data.map((each) => each.said?.(0) ?? '')")
    assert any("yaw of the reference" in line for line in lines)


def turned(signals: Mapping[str, Floats]) -> dict[str, Floats]:
    """A flight that was told east-north-up, told north-east-down."""
    found = dict(signals)
    for names in (PLACE, POSITION_REFERENCE):
        x, y, z = (signals[name] for name in names)
        found |= zip(names, (y, x, -z))
    for names in (ATTITUDE, DESIRED):
        told = [Quaternion.from_xyzw(*each) for each in zip(*(signals[name] for name in names))]
        found |= zip(names, np.array([[*q.vector, q.scalar] for q in (attitude(True, q) for q in told)]).T)
    return found


@in_test_all
def test_a_flight_in_other_axes_is_converted_for_the_replay_only(show: Show, tmp_path: Path) -> None:
    flown = run(scenario().with_changes(parameters={"plant.frame": "enu", "controller.frame": "enu"}))
    twin = dataclasses.replace(flown, system=changed(flown.system, {"components.plant.parameters.frame": "ned"}))
    vars(twin)["signals"] = turned(flown.signals)
    page = show(report(flown, twin, out=tmp_path / "report.html"))
    page.get_by_label("Beside it").select_option("none")
    place = ", ".join(f"{flown.signals[name][0]:.3f}" for name in PLACE)
    pictures = []
    for axes in (f"east, north, up {place} m, ", "north, east, down "):
        assert page.inner_text("#readout").startswith(axes)
        picture = Image.open(io.BytesIO(page.locator("#scene").screenshot()))
        pictures.append(np.asarray(picture.convert("L"), float))
        page.get_by_label("Runs", exact=True).press("ArrowRight")
    page.close()
    one, other = pictures
    assert np.mean(np.abs(one - one.mean()) > 40.0) > 0.005, "there is something to be seen"
    assert np.mean(np.abs(one - other) > 8.0) < 1e-4


def test_hovering_over_a_plot_shows_the_value_with_its_unit(of_runs: Any) -> None:
    plot = of_runs.locator("#time-plot .plot-area").nth(3)
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    of_runs.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    of_runs.wait_for_selector("#time-plot .said:visible")
    said = " ".join(of_runs.locator("#time-plot .said").all_text_contents())
    assert "thrust: " in said
    assert " N" in said
    assert " m" in said, "the panels are linked"


def test_zooming_by_button_narrows_all_panels(of_runs: Any) -> None:
    span = "(() => { const r = document.getElementById('time-plot').layout.xaxis.range; return r[1] - r[0]; })()"
    whole = of_runs.evaluate(span)
    of_runs.get_by_role("button", name="Zoom in").click()
    wait_for(of_runs, f"{span} < {0.6 * whole}")
    of_runs.get_by_role("button", name="Whole run").click()
    wait_for(of_runs, f"{span} > {0.9 * whole}")


def test_a_short_peak_is_clipped_noted_and_shown_in_an_inset_until_zoomed(of_runs: Any) -> None:
    found = """(() => {
        const { data, layout } = document.getElementById('time-plot');
        const notes = layout.annotations.filter((note) => note.text.startsWith('clipped: peak '));
        return [notes.length, data.filter((each) => each.xaxis).length];
    })()"""
    of_runs.get_by_label("Beside it").select_option("none")
    wait_for(of_runs, "!document.getElementById('time-plot').data.some((each) => each.name === 'run 2')")
    notes, lines = of_runs.evaluate(found)
    assert lines >= notes > 0
    of_runs.get_by_role("button", name="Zoom in").click()
    wait_for(of_runs, f"{found}.join() === '0,0'")
    of_runs.get_by_role("button", name="Whole run").click()
    wait_for(of_runs, f"{found}.join() === '{notes},{lines}'")
    of_runs.get_by_label("Beside it").select_option("run 2")


def test_every_control_has_a_name_and_can_be_reached_by_key(of_runs: Any, of_study: Any) -> None:
    nameless = """[...document.querySelectorAll('main button, main input, main select')]
        .filter((e) => !(e.textContent.trim() || e.labels?.[0]?.textContent.trim() || e.ariaLabel) || e.tabIndex < 0)
        .map((e) => e.outerHTML)"""
    for page in (of_runs, of_study):
        assert page.evaluate(nameless) == []
        assert page.locator("main section:visible").count() >= 4
        assert page.locator("h1").count() == 1


def test_a_click_on_a_cell_of_the_map_opens_the_run_behind_it(of_study: Any) -> None:
    plot = of_study.locator("#map-plot .plot-area")
    box = plot.bounding_box()
    of_study.mouse.click(box["x"] + 0.3 * box["width"], box["y"] + 0.3 * box["height"])
    wait_for(of_study, "document.getElementById('run-title').textContent.startsWith('Run 1')")
    assert "period 10 ms" in of_study.inner_text("#run-text")
    assert of_study.is_visible("#scene")
    of_study.locator("#map-plot").press("ArrowDown")
    assert title(of_study).startswith("Run 0")


def test_a_box_over_the_map_chooses_among_the_runs_until_all_are_taken_again(of_study: Any) -> None:
    box = of_study.locator("#map-plot .plot-area").bounding_box()
    of_study.mouse.move(box["x"] + 0.05 * box["width"], box["y"] + 0.05 * box["height"])
    of_study.mouse.down()
    of_study.mouse.move(box["x"] + 0.45 * box["width"], box["y"] + 0.95 * box["height"])
    of_study.mouse.up()
    wait_for(of_study, "document.getElementById('map-hint').textContent.startsWith('In the box: 2 of 4 runs, ')")
    assert of_study.get_by_label("2 of the box").is_visible()
    of_study.get_by_role("button", name="All runs").click()
    wait_for(of_study, "!document.getElementById('map-hint').textContent.startsWith('In the box: ')")
    assert of_study.get_by_label("Flights").is_visible()


def test_marks_of_diverged_runs_are_visibly_below_all_values(of_study: Any) -> None:
    controls = of_study.locator("#map-controls select")
    controls.nth(2).select_option("value")
    heights = "Object.fromEntries(document.getElementById('map-plot').data.map((one) => [one.name, one.y]))"
    wait_for(of_study, "document.getElementById('map-plot').data[0].name !== undefined")
    found = of_study.evaluate(heights)
    (down,) = (y for name, y in found.items() if name == "diverged (1; without a value at the foot)")
    assert max(down) < 0.99 * min(y for name, ys in found.items() if "foot" not in name for y in ys if y)
    controls.nth(2).select_option("timing.delay")


def test_a_second_study_is_drawn_over_the_first(of_study: Any, show: Show) -> None:
    """The same study twice: the edges and shares of both are the same."""
    folder = Path(of_study.url.removeprefix("file://")).parent
    page = show(report(folder, folder, out=folder / "twice.html"))
    assert f" Over it {folder.name}: 4 runs: " in page.inner_text("#summary")
    assert f"dashed line: that of {folder.name}" in page.inner_text("#map-hint")
    traces = "document.getElementById('map-plot').data"
    edge, other = page.evaluate(
        f"{traces}.filter((one) => one.mode === 'lines').map((one) => [one.x, one.y, one.line.dash])"
    )
    assert edge[:2] == other[:2]
    assert (edge[2], other[2]) == (None, "dash")
    wait_for(page, "document.getElementById('shares-plot').data?.length === 2")
    own, others = page.evaluate("document.getElementById('shares-plot').data.map((each) => [each.x, each.y])")
    assert own == others
    page.close()


def test_of_two_studies_over_one_axis_the_metric_of_all_seeds_is_drawn_with_the_means(
    show: Show, tmp_path: Path
) -> None:
    axes = [{"name": "timing.loss", "values": [0.0, 0.3]}, {"name": "seed", "values": [1, 2, 3]}]
    swept = []
    for name, height in (("low", 1.0), ("high", 2.0)):
        base = {"stop_time": 0.02, "timing": {"plant_interval": 0.005}, "plant": {"initial.position.z": height}}
        tables = {"name": name, "base": base, "axes": axes, "design": {"repeat": "seed"}}
        swept.append(sweep(load_study(tables), out=tmp_path / name))
    page = show(report(*swept, out=tmp_path / "both.html", flights=0))
    drawn = page.evaluate("document.getElementById('map-plot').data.map(({ name, x, y }) => [name, x, y])")
    assert page.locator("#map-plot text").all_text_contents()[:2] == ["0", "0.3"]  # ticks across: values that there are
    page.close()
    heights = {name: (x, y) for name, x, y in drawn}
    for name, outcome in (("low", "bounded"), ("high", "settled")):
        across, up = heights[f"{name}: {outcome} (6)"]
        assert heights[f"{name}: mean"] == ([across[0], across[-1]], pytest.approx([sum(up[:3]) / 3, sum(up[3:]) / 3]))


def test_an_axis_of_words_has_a_tick_for_each_and_its_cells_fill_the_map(show: Show, tmp_path: Path) -> None:
    file = tmp_path / "orders.toml"
    file.write_text(
        "[base]\nstop_time = 0.02\n[base.timing]\nplant_interval = 0.005\n"
        '[[axes]]\nname = "timing.order"\nvalues = ["gauss-seidel", "jacobi"]\n'
        '[[axes]]\nname = "plant.initial.position.z"\nvalues = [0.0, 2.0]\n'  # the second is good: there is an edge
    )
    sweep(load_study(file), out=tmp_path)
    page = show(report(file, out=tmp_path, flights=1, runs=[0]))
    texts = page.locator("#map-plot text").all_text_contents()
    assert {"gauss-seidel", "jacobi"} <= {*texts}
    assert "-0.5" not in texts  # the end of the edge, which is no word; ticks of numbers have another minus
    page.close()


def test_a_study_of_two_laws_that_repeats_opens_on_their_difference_with_its_seeds_folded(
    show: Show, tmp_path: Path
) -> None:
    file = tmp_path / "laws.toml"
    file.write_text(
        '[base]\nstop_time = 0.02\n[base.timing]\nplant_interval = 0.005\n[design]\nrepeat = "seed"\n'
        '[[axes]]\nname = "controller"\nvalues = ["UnifiedController", "CascadedController"]\n'
        '[[axes]]\nname = "timing.period"\nvalues = [0.01, 0.02]\n'
        '[[axes]]\nname = "timing.loss"\nvalues = [0.0, 0.5]\n[[axes]]\nname = "seed"\nvalues = [1, 2]\n'
    )
    swept = sweep(load_study(file), out=tmp_path)
    page = show(report(file, out=tmp_path, flights=16))
    chosen = page.locator("#map-controls select")
    opened = chosen.evaluate("select => select.selectedOptions[0].textContent")
    assert opened == "difference, CascadedController minus UnifiedController"
    assert page.inner_text("#cell-title") == "period 10 ms, loss 0.5"
    assert page.get_by_label("4 of the cell").is_visible()  # two seeds of two laws
    marks = page.evaluate("document.getElementById('cell-plot').data.map((one) => [one.name, one.marker.symbol])")
    assert marks[:2] == [
        ["UnifiedController: bounded (2)", "x-thin-open"], ["CascadedController: bounded (2)", "cross-thin-open"],
    ]  # fmt: skip
    chosen.select_option("0")
    assert page.get_by_label("2 of the cell").is_visible()
    page.locator("#map-plot").press("ArrowRight")
    wait_for(page, "document.getElementById('cell-title').textContent === 'period 20 ms, loss 0.5'")
    assert "0 of 2 settled: 0 %, 95 % interval 0 % to 65.8 %" in page.inner_text("#cell-text")
    assert {"0/2", "0/1"} <= {*page.locator("#map-plot text").all_text_contents()}
    box = "(one) => { const { x, y, width, height } = one.getBBox(); return [x, y, x + width, y + height]; }"
    left, top, right, bottom = page.locator("#map-plot rect[stroke='#fff']").evaluate(box)
    numbers = [each.evaluate(box) for each in page.locator("#map-plot text", has_text="0/2").all()]
    assert any(left < a and top < b and c < right and d < bottom for a, b, c, d in numbers)  # its frame is around it
    page.close()
    page = show(report(swept, swept, out=tmp_path, flights=0))
    marks = page.evaluate("document.getElementById('cell-plot').data.map((one) => [one.name, one.marker.symbol])")
    assert marks[:2] == [["laws: bounded (2)", "x-thin-open"], ["laws: bounded (2)", "cross-thin-open"]]
    page.close()


def test_where_nothing_moves_there_is_no_button_to_play_it_and_short_times_are_in_ms(
    show: Show, tmp_path: Path
) -> None:
    servo = changed(load_system(EXAMPLES / "double_integrator" / "system.toml"), {"stop_time": 0.5})
    page = show(report(run(servo), out=tmp_path / "report.html"))
    assert page.get_by_label("Time", exact=True).is_visible()
    assert not page.get_by_role("button", name="Play").is_visible()
    page.get_by_label("Time", exact=True).press("End")
    assert page.inner_text("#player output") == "500.00 ms"
    texts = page.locator("#time-plot text").all_text_contents()
    assert {"time [ms]", "100", "400"} <= {*texts}
    page.close()


@in_test_all
def test_the_map_of_a_comparison_says_what_its_numbers_are(of_comparison: Any) -> None:
    assert of_comparison.inner_text("#map-title") == "Share of the starts that survives"


def test_the_slider_goes_over_the_flights_of_the_open_cell(of_comparison: Any) -> None:
    slider = of_comparison.get_by_label("2 of the cell")
    first = title(of_comparison)
    slider.press("End")
    last = title(of_comparison)
    slider.press("ArrowRight")
    assert title(of_comparison) == last != first
    of_comparison.locator("#map-plot").press("ArrowRight")
    wait_for(of_comparison, "document.getElementById('cell-title').textContent.includes('20 ms')")
    wait_for(of_comparison, f"document.getElementById('run-title').textContent !== {last!r}")
    assert "period 20 ms" in of_comparison.inner_text("#run-text")
    slider.press("End")
    assert "period 20 ms" in of_comparison.inner_text("#run-text")


def test_the_lines_of_a_comparison_have_the_names_of_their_controllers(of_comparison: Any) -> None:
    wait_for(of_comparison, "document.getElementById('shares-plot').layout?.annotations?.length === 1")
    assert of_comparison.evaluate("document.getElementById('shares-plot').layout.annotations[0].text") == "own"


def test_hovering_over_a_cell_shows_settings_and_metric(of_study: Any) -> None:
    box = of_study.locator("#map-plot .plot-area").bounding_box()
    of_study.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.7 * box["height"])
    wait_for(of_study, "document.querySelector('#map-plot .said')?.textContent.includes('run 0: ')")
    said = of_study.locator("#map-plot .said").text_content()
    assert "period: 10 ms" in said
    assert "largest position error" in said


def test_a_run_whose_flight_is_not_in_the_file_shows_its_metrics_and_the_nearest_flight(of_study: Any) -> None:
    of_study.get_by_label("Run", exact=True).fill("3")
    of_study.get_by_label("Run", exact=True).press("Enter")
    assert title(of_study).startswith("Run 3")
    assert "--run 3" in of_study.inner_text("#run-text")
    assert not of_study.is_visible("#scene")
    of_study.get_by_role("button", name="Show the nearest that is").click()
    assert not title(of_study).startswith("Run 3")
    assert of_study.is_visible("#scene")


def test_the_page_states_its_contents_and_how_it_was_made(of_study: Any) -> None:
    contents = of_study.inner_text("#contents")
    assert "Metrics of all 4 runs are in this file, and the signals of 3 of them" in contents
    assert "All reruns agree with the store." in contents
    assert "quadcosim report" in contents
    assert "GUID of the plant" in contents


def test_the_page_and_its_plots_are_dark_where_the_system_is_until_a_button_is_used(of_runs: Any) -> None:
    colors = """[getComputedStyle(document.querySelector('main section')).backgroundColor,
        ...['layout.paper_bgcolor', 'data.0.line.color'].map((path) =>
            path.split('.').reduce((found, key) => found[key], document.getElementById('time-plot')))]"""
    light = of_runs.evaluate(colors)
    of_runs.emulate_media(color_scheme="dark")
    wait_for(of_runs, "document.documentElement.dataset.scheme === 'dark'")
    dark = of_runs.evaluate(colors)
    assert all(one != other for one, other in zip(light, dark))
    of_runs.get_by_role("button", name="Light").click()
    assert of_runs.evaluate(colors) == light
    of_runs.emulate_media(color_scheme="light")


def test_on_a_phone_nothing_is_wider_than_the_page_and_signals_come_before_metrics(of_runs: Any, of_study: Any) -> None:
    for page in (of_runs, of_study):
        page.set_viewport_size({"width": 390, "height": 844})
        wait_for(page, "document.documentElement.scrollWidth <= 390")
        tops = [page.locator(f"#{name}").bounding_box()["y"] for name in ("run", "signals", "facts")]
        assert tops == sorted(tops)
        page.set_viewport_size({"width": 1400, "height": 900})


def test_with_reduced_motion_the_replay_shows_a_picture_a_second(of_runs: Any) -> None:
    of_runs.emulate_media(reduced_motion="reduce")
    of_runs.get_by_label("Time", exact=True).fill("0")
    of_runs.get_by_role("button", name="Play").click()
    wait_for(of_runs, "parseFloat(document.querySelector('#player output').textContent) > 0")
    assert clock(of_runs) >= 1.0
    of_runs.get_by_role("button", name="Pause").click()
    of_runs.emulate_media(reduced_motion="no-preference")
