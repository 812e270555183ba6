"""`expect` of systems with FMUs: known answers, and what is refused by name."""

import dataclasses
import json
import math
import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from orchestration.command.exact import warn_if_means_are_infinite
from orchestration.experiments.studies.infinite_means import InfiniteMeans
from orchestration.experiments.studies.study_file import load_study
from orchestration.foundation.basics.bisection import Range
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.systems.expressions.syntax import parse
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Source
from orchestration.systems.system.file import system_from_tables
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import Criterion, System
from orchestration.systems.system.paths import changed
from orchestration.theory.certificates.margin import linear_loop_of
from orchestration.theory.exact import flown, mean_square, moments
from orchestration.theory.exact.as_simulated import expect_rows
from orchestration.theory.exact.expect import Expected, expect, expected_of
from orchestration.theory.exact.loops import SURE, Converged, Loops, expect_same_steps
from orchestration.theory.exact.mean_square import NO_EXPECTATION, NO_VARIANCE, MeanSquares
from orchestration.theory.exact.objectives import has_mean_of_squares, means_of
from orchestration.theory.exact.random_times import CERTAIN, RandomLink, RandomTime, SampledTask, exact_seconds
from orchestration.theory.exact.timing import sampled_tasks
from orchestration.theory.stability.excitation import Rest
from orchestration.theory.stability.identification import in_continuous_time
from orchestration.theory.stability.linearised_component import Tangent
from orchestration.theory.stability.matrices import SampledSystem
from quadcosim import UsageError, limit, load_system, sweep
from tests.commands import Main
from tests.examples.common import native_example as example
from tests.extent import in_test_all
from tests.orchestration.components.fmi.small import needs_compiler
from tests.places import EXAMPLES


def expected(name: str, **changes: Any) -> Expected:
    return expect(example(name, {key.replace("__", "."): value for key, value in changes.items()}))


def test_minimum_variance_control_costs_what_theory_says_through_its_fmus() -> None:
    found = expected("minimum_variance")
    assert found.objectives["variance"] == pytest.approx((3.0 + math.sqrt(3.0)) / 6.0, abs=1e-9)
    assert found.objectives["effort"] == pytest.approx(math.sqrt(3.0), abs=1e-9)
    assert found.accuracy < 1e-9
    assert not found.reasons


def test_of_one_system_after_the_other_only_components_that_change_are_measured_again() -> None:
    one, other = (example("distributed_servo", {"components.controller.parameters.K": K}) for K in (1.5, 1.0))
    loops = Loops(files_of(one).models)
    first, second = loops.linear(one).parts, loops.linear(other).parts
    assert second["servo"] is first["servo"]
    assert pytest.approx(first["controller"].D / 1.5, rel=1e-9) == second["controller"].D
    assert expected_of(other, loops).objectives == pytest.approx(expect(other).objectives, rel=1e-12)


def test_costs_are_as_accurate_as_those_of_components_with_the_errors_of_their_measurement(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    system = example("distributed_servo", {"components.controller.parameters.K": 1.0})
    loops = Loops(files_of(system).models)
    linear = loops.linear(system)
    near = {**linear.parts, "servo": dataclasses.replace(linear.parts["servo"], A=linear.parts["servo"].A * 1.000001)}

    def solved(**changed: Any) -> Converged[Any]:
        monkeypatch.setattr(loops, "linear", lambda system: dataclasses.replace(linear, **changed))
        return loops.solve(system, judged=True).loop

    measured, other = solved(others=[near, near]), solved(parts=near, others=[near])
    change = np.abs(other.numbers[1:] / measured.numbers[1:] - 1.0).max()
    assert change > 1e-7
    assert (measured.sensitivity, other.sensitivity) == (pytest.approx(SURE * change), 0.0)
    unstable = dataclasses.replace(linear.parts["servo"], B=linear.parts["servo"].B * 100.0)
    assert solved(others=[{**linear.parts, "servo": unstable}]).sensitivity == 1.0


def test_with_a_uniform_delay_through_its_fmus_too() -> None:
    found = expected("minimum_variance", connections__command__delay_jitter=0.5)
    assert found.objectives["variance"] == pytest.approx(1.2186963044, abs=1e-9)


def test_a_mean_that_has_no_finite_expectation_is_none_and_says_why() -> None:
    found = expected("minimum_variance", connections__command__loss=0.3)
    assert found.objectives == {"variance": None, "effort": None}
    assert found.mean_square_radius > 1.0
    assert found.reasons["variance"].startswith("the mean-square radius is 1.16999")


def test_objectives_that_are_no_means_of_squares_are_refused_by_name_and_the_radius_is_there() -> None:
    found = expected("dc_servo", connections__command__loss=0.0, connections__command__delay_jitter=0.0)
    assert found.objectives == {"middle": None, "late": None, "cost": None}
    assert found.reasons["cost"].startswith("integral(…): expected mean(…) or rms(…)")
    assert found.mean_square_radius == pytest.approx(0.9324**2, abs=1e-4)
    with pytest.raises(UsageError, match=r"^mean\(missed\(inner\)\): of the jobs of a task there are no expectations"):
        means_of(parse("mean(tank.level) + 2 * mean(missed(inner))"))


def test_objectives_may_be_made_of_means_and_of_signals_that_no_connection_carries() -> None:
    servo = dataclasses.replace(example("dc_servo", {"connections.command.loss": 0.0}), criterion=Criterion())
    noisy = dataclasses.replace(
        servo, sources={"torque": Source(noise=1e-4, period=0.001, to=("controller.reference",))}, objectives={}
    )
    with pytest.raises(UsageError, match=r"sources\.torque: white noise into controller\.reference, which samples it"):
        expect(noisy)
    measured = dataclasses.replace(
        servo,
        connections=(dataclasses.replace(servo.connections[0], noise={"angle": 0.01}), servo.connections[1]),
        objectives={
            "speed": "rms(servo.speed)",
            "both": "mean(servo.angle ** 2 + 0.1 * servo.speed * servo.angle) + 2 * speed",
            "inner": "mean(controller.integral ** 2)",
            "third": "mean(servo.angle ** 3)",
            "late": "mean(time * servo.angle)",
        },
    )
    found = expect(measured)
    speed, both = found.objectives["speed"], found.objectives["both"]
    assert speed is not None
    assert both is not None
    assert both > 2.0 * speed > 0.0
    assert found.objectives["inner"] is not None
    assert found.reasons == {
        "third": "servo.angle ** 3: expected a polynomial of signals of degree two at most",
        "late": "depends on time: expected signals alone, whose mean is stationary",
    }


def test_the_command_prints_what_it_found(main: Main) -> None:
    path = EXAMPLES / "minimum_variance/system.toml"
    document = json.loads(main("expect", path, "--set", "connections.command.loss=0.2", "--json").stdout)
    assert document["objectives"]["variance"] == pytest.approx(5.8867513459, abs=1e-9)
    assert document["mean_square_radius"] < 1.0 < document["fourth_moment_radius"]
    lines = main("expect", path, "--set", "connections.command.loss=0.2").stdout
    assert lines.startswith("variance = 5.887, effort = ")
    assert "variance              5.8867513" in lines
    assert "confidence intervals of mean squares over runs are meaningless here" in lines


def test_a_loop_with_too_many_fourth_moments_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moments, "MAX_FOURTH_PRODUCTS", 0.0)
    system = example("minimum_variance", {"connections.command.loss": 0.2})
    found = expected_of(system, Loops(files_of(system).models))
    assert (found.fourth_moment_radius, found.reasons) == (
        None, {"fourth_moment_radius": "too many fourth moments to compute"},
    )  # fmt: skip


def test_radii_of_many_systems_show_how_far_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    shares = list[float]()
    loop = SimpleNamespace(radius=2.0)
    monkeypatch.setattr(mean_square, "Loops", lambda _, nearly: SimpleNamespace(jump_linear=lambda _, agree: loop))
    monkeypatch.setattr(mean_square, "progress_bar", lambda _: nullcontext(shares.append))
    found = mean_square.growths_of(cast("Any", [SimpleNamespace(components={})] * 2), {})
    assert found == [MeanSquares(remark=NO_EXPECTATION, radius=2.0)] * 2
    assert shares == [0.0, 0.5]


def test_a_system_that_expect_refuses_is_not_examined_and_the_reason_is_kept() -> None:
    fine = example("minimum_variance", {"connections.command.loss": 0.2})
    sampled = Source(noise=1.0, period=0.1, to=("controller.x",))
    noisy = dataclasses.replace(fine, connections=fine.connections[1:], sources={**fine.sources, "noisy": sampled})
    models = files_of(fine).models
    refused, wide = mean_square.growths_of([noisy, fine], models)
    assert refused.remark.startswith("not examined: sources.noisy: white noise into controller.x, which samples it")
    assert wide.remark == NO_VARIANCE
    assert wide.radius == pytest.approx(Loops(models).solve(fine).loop.result.fourth_moment_radius)


def test_fourth_moments_of_a_large_loop_are_left_to_expect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mean_square, "MAX_FOURTH_WORK", 1.0)
    lossy, sure = (example("minimum_variance", {"connections.command.loss": loss}) for loss in (0.2, 0.0))
    found = mean_square.growths_of([lossy, sure], files_of(lossy).models)
    assert [one.remark for one in found] == ["variance not examined: too many fourth moments", ""]


@pytest.mark.parametrize(
    ("text", "squares"),
    [
        ("mean(x ** 2)", True), ("2 * mean(x * y) + rms(x)", True), ("mean(abs(x))", True),
        ("rms(x - y)", False), ("mean(2 * (x - y) / 3)", False),
    ],
)  # fmt: skip
def test_means_of_products_have_a_variance_of_fourth_moments(text: str, squares: bool) -> None:
    assert has_mean_of_squares(parse(text)) == squares


@pytest.mark.parametrize("rests", [{}, {"after": 3.0}])
def test_a_run_with_noise_that_leaves_what_is_linear_puts_the_expectation_in_doubt(
    rests: dict[str, float], main: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = dataclasses.replace(example("minimum_variance"), operating_point=rests)
    narrow = dataclasses.replace(system, criterion=Criterion(diverged="abs(plant.x) > 1.5"))
    plain, found = expect(system), expect(narrow)
    assert plain.doubt == ""
    assert re.match(r"a run from rest with this noise \(seed 0\) diverges after \d[.\d]* s: the expect", found.doubt)
    assert found.objectives == plain.objectives
    assert not expect(dataclasses.replace(narrow, sources={})).doubt  # rests
    path = tmp_path / "system.toml"
    path.write_text(narrow.to_toml())
    assert main("expect", path).stdout.splitlines()[1] == f"warning: {found.doubt}"
    monkeypatch.setattr(flown, "BY_CHANCE", 0.1)
    assert "has a mean(plant.x ** 2) of more than 0.1 times the expected" in expect(system).doubt


def test_what_is_shown_has_the_digits_that_the_accuracy_vouches_for() -> None:
    known = Expected(
        objectives={"cost": 8.06196e-06}, reasons={}, mean_square_radius=0.9, fourth_moment_radius=None, accuracy=1e-11,
        method="", period=1.0,
    )  # fmt: skip
    for accuracy, text in (
        (0.0, "8.062e-06"),
        (1e-11, "8.062e-06"),
        (0.002, "8.1e-06"),
        (0.05, "8e-06"),
        (2.0, "8e-06"),
    ):
        found = dataclasses.replace(known, accuracy=accuracy)
        assert found.verdict.startswith(f"cost = {text} (stationary)")
        assert found.shown(8.06196e-06, 4) == text


def as_simulated(**changes: Any) -> float:
    settings = {key.replace("__", "."): value for key, value in changes.items()}
    found = expect(example("minimum_variance", settings), as_simulated=True).objectives["variance"]
    assert found is not None
    return found


def test_as_simulated_noise_is_held_and_the_mean_is_over_rows() -> None:
    assert as_simulated() == pytest.approx(0.791562, abs=5e-7)


def test_with_finer_rows_the_mean_as_simulated_becomes_that_over_time_of_noise_that_is_held() -> None:
    coarse, fine = (as_simulated(components__plant__step=step) for step in (0.01, 0.005))
    assert (4.0 * fine - coarse) / 3.0 == pytest.approx(0.772008, abs=5e-7)


def test_with_finer_noise_and_rows_it_becomes_that_of_white_noise() -> None:
    coarse, fine = (as_simulated(components__plant__step=step, sources__noise__period=step) for step in (0.01, 0.005))
    assert (4.0 * fine - coarse) / 3.0 == pytest.approx((3.0 + math.sqrt(3.0)) / 6.0, abs=1e-6)


def test_as_simulated_refuses_rows_at_which_the_plant_is_not_stepped() -> None:
    with pytest.raises(UsageError, match=r"measurement is measured between the steps of plant: expected .* of 0\.1 s"):
        as_simulated(connections__measurement__delay=0.05)


def test_as_simulated_names_what_lets_a_message_arrive_between_the_steps() -> None:
    tables: dict[str, Any] = {
        "stop_time": 1.0,
        "components": {
            "drive": {"fmu": "a.fmu", "step": 1e-4},
            "speed": {"fmu": "b.fmu", "sampling": {"period": 2e-3}},
            "current": {"fmu": "c.fmu", "sampling": {"period": 2e-4}},
        },
        "connections": [{"name": "bus", "from": ["speed.y"], "to": ["current.u"], "delay": 6e-4, "delay_jitter": 4e-4}],
    }
    tasks = [SampledTask(name=n, period=exact_seconds(T)) for n, T in (("speed", 2e-3), ("current", 2e-4))]
    late = RandomTime(values=(0, 4 * 10**14), probabilities=())
    bus = RandomLink(name="connections.bus", size=1, sender=0, receiver=1, delay=6 * 10**14, delay_jitter=late)
    system = system_from_tables(tables, Path())
    with pytest.raises(UsageError, match=r"arrives between the steps of drive: expected no delay_jitter, or"):
        expect_rows(system, tasks, [bus])
    expect_rows(system, tasks, [dataclasses.replace(bus, delay_jitter=CERTAIN)])
    with pytest.raises(UsageError, match=r"drive: expected a step of which its delay is a multiple, or"):
        expect_rows(system, tasks, [dataclasses.replace(bus, delay_jitter=CERTAIN, delay=10**13)])


@pytest.mark.parametrize(("burst", "expected"), [(None, 0.2240092377), (2.0, 0.1443375673)])
def test_the_limit_of_losses_has_the_mean_square_limit_of_theory(burst: float | None, expected: float) -> None:
    system = example("minimum_variance", {"stop_time": 5.0, "connections.command.burst_length": burst})
    found = limit(
        system, "connections.command.loss", first=0.1, last=0.3, scan=0.1, tolerance=1e-4, progress=None, announce=None
    )
    assert found.mean_square_limit == pytest.approx(expected, abs=1e-6)
    (note,) = (note for note in found.notes if note.startswith("just above "))
    bad = 0.3 if expected > 0.2 else 0.2
    tried = f"nor have they at what was tried above, up to {bad}; other values above may have one again"
    assert note.endswith(f" means of squares have no finite expectation; {tried}")


def test_a_limit_of_a_loop_without_chance_has_no_mean_square_limit() -> None:
    system = example("minimum_variance", {"stop_time": 5.0, "sources.noise.noise": 0.0})
    found = limit(system, "connections.command.delay", first=0.1, last=0.2, progress=None, announce=None)
    assert found.mean_square_limit is None
    assert "square" not in "\n".join(found.notes)


@in_test_all
def test_where_noise_alone_is_random_the_mean_square_limit_is_the_local_one() -> None:
    system = example("minimum_variance", {"stop_time": 5.0})
    system = dataclasses.replace(
        system, operating_point={"components.controller.parameters.gain": 3.0 - math.sqrt(3.0)}
    )
    found = limit(
        system, "connections.command.delay", first=0.0, last=0.9, tolerance=1e-4, confidence=0.2, progress=None,
        announce=None,
    )  # fmt: skip
    assert found.mean_square_limit is not None
    assert found.mean_square_limit == found.local_limit
    below, above = (
        expected("minimum_variance", connections__command__delay=found.mean_square_limit + apart).mean_square_radius
        for apart in (-2e-4, 2e-4)
    )
    assert below < 1.0 < above


@needs_compiler
@pytest.mark.parametrize("loop_of", [expect, linear_loop_of], ids=["expect", "margin"])
def test_native_twins_are_linearised_if_available(
    loop_of: Callable[[System], object], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    loaded = list[Path]()
    monkeypatch.setattr(f"{loop_of.__module__}.isolated_call", lambda fmus, *_: loaded.extend(fmus))
    system = load_system(EXAMPLES / "minimum_variance/system.toml")
    loop_of(system)
    assert {path.parent.name for path in loaded} == {"native"}
    of_means = list[str]()

    def called(fmus: Iterable[str], *_: object) -> list[MeanSquares]:
        of_means.extend(fmus)
        return [MeanSquares()]

    monkeypatch.setattr(mean_square, "isolated_call", called)
    warn_if_means_are_infinite(system)
    once = {"name": "once", "base": system, "axes": [{"name": "stop_time", "values": [1.0]}]}
    sweep(once, engine="python", out=tmp_path, progress=None, announce=None)
    assert of_means == [*loaded, *loaded]


def test_means_of_squares_say_what_would_be_faster_if_they_take_long(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(mean_square, "isolated_call", lambda *_: [MeanSquares()])
    monkeypatch.setattr(mean_square, "_with_twins", lambda *as_they_are: as_they_are)
    system = load_system(EXAMPLES / "minimum_variance/system.toml")
    for long, remarks in ((math.inf, 0), (-1.0, 1)):
        monkeypatch.setattr(mean_square, "LONG", long)
        warn_if_means_are_infinite(system)
        assert capsys.readouterr().err.count("by FMUs in Python; quadcosim build --native makes") == remarks


def test_rates_far_apart_are_not_examined_by_a_run_and_a_line_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    examined = list[int]()

    def known(systems: Sequence[System], models: object) -> list[MeanSquares]:
        examined.append(len(systems))
        return [MeanSquares(remark=NO_EXPECTATION, radius=2.0)] * len(systems)

    monkeypatch.setattr(mean_square, "growths_of", known)
    system = load_system(EXAMPLES / "minimum_variance/system.toml")
    fast = dataclasses.replace(system.components["controller"], sampling=Sampling(period=0.25))
    cascade = dataclasses.replace(system, components={**system.components, "inner": fast})
    near, far = (changed(cascade, {"components.controller.sampling.period": period}) for period in (1.0, 100.0))
    files = files_of(system)
    found = mean_square.mean_squares(system, [far, near], files)
    why = "not examined: a hyperperiod of more than 250 samples; quadcosim expect does, or says why not"
    assert ([one.remark for one in found], examined) == ([why, NO_EXPECTATION], [1])
    warn_if_means_are_infinite(far)
    assert capsys.readouterr().err == f"means of squares {why}\n"


def test_a_run_that_is_interrupted_while_means_are_examined_has_printed_its_result(
    main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(mean_square, "mean_squares", stop)
    stopped = main("run", EXAMPLES / "minimum_variance/system.toml", "--set", "stop_time=5", code=130)
    assert "variance" in stopped.stdout
    assert stopped.stderr.endswith("interrupted with the result printed, but means of squares not examined\n")


NO_END = "variance, effort: without a finite expectation"


def test_a_run_says_that_its_averages_mean_nothing(main: Main) -> None:
    path, loss = EXAMPLES / "minimum_variance/system.toml", "connections.command.loss"
    lossy = main("run", path, "--set", "stop_time=20", "--set", f"{loss}=0.3")
    assert f"{NO_END}, so an average over runs means nothing; the mean-square radius is 1.16999" in lossy.stderr
    assert NO_END not in main("run", path, "--set", "stop_time=20", "--set", f"{loss}=0.2").stderr


def test_a_sweep_names_the_points_after_its_runs_and_their_means_have_no_interval(
    main: Main, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, store = tmp_path / "study.toml", tmp_path / "store"
    study.write_text(
        f"""
name = "losses"
scenario = "{EXAMPLES / "minimum_variance/system.toml"}"
[[axes]]
name = "loss"
sets = ["connections.command.loss"]
values = [0.1, 0.2, 0.3]
[[axes]]
name = "length"
sets = ["stop_time"]
values = [5.0]
[[axes]]
name = "seed"
values = [1, 2]
[design]
repeat = "seed"
"""
    )
    told = f"{NO_END} at 1 of 3 points (loss 0.3, length 5 s), so an average over runs means nothing"

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    table = ("export", study, "--store", store, "--metric", "variance", "--mean", "--table", "markdown")
    with monkeypatch.context() as at_once:
        at_once.setattr(InfiniteMeans, "of", stop)
        stopped = main("sweep", study, "--out", store, code=130).stderr
        assert stopped.endswith("interrupted with all runs done, but means of squares not yet examined\n")
    unknown = "which means of squares are finite is not yet examined"
    assert unknown in main(*table).stderr
    done = main("sweep", study, "--out", store)
    assert told in done.stderr
    assert done.stdout.splitlines()[1].endswith("6 runs, 0 of them new")
    table_with_them = main(*table)
    printed = table_with_them.stdout
    assert unknown not in table_with_them.stderr
    assert [line.count("no finite expectation") for line in printed.splitlines()[2:5]] == [0, 0, 1]
    assert "2 cells without an interval: no finite variance" in printed
    found = InfiniteMeans.in_store(store / "study.sqlite", load_study(study))
    assert found.remarks == {NO_EXPECTATION: ((0.3, 5.0),), NO_VARIANCE: ((0.1, 5.0), (0.2, 5.0))}


def test_a_plant_is_measured_once_for_shorter_periods_to_the_accuracy_of_a_radius(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    systems = [
        example("minimum_variance", {"components.controller.sampling.period": period, "connections.command.loss": loss})
        for period, loss in ((0.5, 0.1), (1.0, 0.1), (1.0, 0.3))
    ]
    models, measured = files_of(systems[0]).models, list[float]()
    exact = [mean_square.growths_of([system], models)[0].radius for system in systems]

    def counted(rest: Rest, period: float, step: float, *, until: float, unit: float | None) -> Tangent:
        measured.append(period)
        return in_continuous_time(rest, period, step, until=until, unit=unit)

    monkeypatch.setattr("orchestration.theory.stability.loop_at_rest.in_continuous_time", counted)
    radii = [one.radius for one in mean_square.growths_of(systems, models)]
    assert radii == pytest.approx(exact, rel=1e-6)
    assert measured == [1.0]


def test_what_fails_with_a_component_as_in_other_systems_is_measured_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    def linearised(loops: Loops, *_: object) -> str:
        if loops._tangents:
            raise UsageError("not precise enough")
        return "anew"

    monkeypatch.setattr(Loops, "_linearised", linearised)
    loops = Loops({}, nearly=True)
    assert loops._tangents is not None
    loops._tangents["plant"] = cast("Any", None)
    assert loops.linear(example("minimum_variance")) == cast("Any", "anew")


def test_what_is_too_much_to_linearise_is_left_out_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mean_square, "MAX_LINEARISED", 1)
    infinite = MeanSquares(remark=NO_EXPECTATION, radius=2.0)
    monkeypatch.setattr(mean_square, "growths_of", lambda systems, models: [infinite] * len(systems))
    changes = [
        {"connections.command.loss": loss, "components.controller.parameters.gain": gain}
        for gain in (1.0, 1.2)
        for loss in (0.1, 0.2)
    ]
    systems = [example("minimum_variance", each) for each in changes]
    found = mean_square.mean_squares(systems[0], systems, files_of(systems[0]))
    left_out = MeanSquares(remark=f"not examined: {mean_square.TOO_MANY}")
    assert found == [infinite, infinite, left_out, left_out]


@needs_compiler
def test_what_is_not_linear_is_known_by_small_pulses_to_the_accuracy_of_a_predicted_response() -> None:
    flight = Scenario(
        controller=FmuChoice(fmu="native/UnifiedController"), plant=FmuChoice(fmu="native/QuadrotorPlant"),
        timing=Timing(period=0.011, noise={"position": 1e-4}),
    )  # fmt: skip
    found = expect(flight)
    assert found.mean_square_radius == pytest.approx(HoverLoop.of(flight).spectral_radius(0.011, 0.0) ** 2, rel=1e-6)
    assert found.accuracy < 1e-7
    assert found.objectives["position_rmse"] == pytest.approx(2.8758e-5, rel=1e-4)


def test_a_task_that_minds_how_long_its_step_is_has_no_jitter() -> None:
    system = example("minimum_variance", {"components.controller.sampling.jitter": 0.1})
    none = np.zeros((0, 0))
    minding = SampledSystem(inputs=(), outputs=(), A=none, B=none, C=none, D=none, depends_on_step=True)
    with pytest.raises(
        UsageError, match=r"components\.controller\.sampling\.jitter: the samples of controller depend on"
    ):
        expect_same_steps(system, sampled_tasks(system), {"controller": minding})
    regular = example("minimum_variance")
    expect_same_steps(regular, sampled_tasks(regular), {"controller": minding})


def test_a_mean_square_limit_is_as_exact_as_the_radius() -> None:
    class Radii:
        def radius(self, system: System, *, agree: float) -> float:
            return 0.8 + 0.7 * system.stop_time**2

    span = Range(first=0.1, step=0.1, last=1.0, tolerance=0.2)
    found = mean_square._crossing(
        System(stop_time=0.1, components={"plant": Component(fmu="none", step=0.1)}, connections=()),
        ["stop_time"],
        span,
        cast(Loops, Radii()),
    )
    assert found.limit == pytest.approx(math.sqrt(2.0 / 7.0), abs=1e-8)
