"""What is certified of systems and of the quadrotor about hover, what breaks them, and certificates of other loops."""

import functools
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.command.cli import main
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import time_text
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.theory.certificates import margin as certificates
from orchestration.theory.certificates import region as regions
from orchestration.theory.certificates.breaking import breaking_at, breaking_losses
from orchestration.theory.certificates.certified_loop import CertifiedLoop
from orchestration.theory.certificates.check_file import check_certificate
from orchestration.theory.certificates.family import Factor, Letter, LoopFamily
from orchestration.theory.certificates.find_certificate import find_certificate, parts_of
from orchestration.theory.certificates.margin import (
    Certified,
    linear_loop_of,
    margin,
    small_gain,
    varying_of,
)
from orchestration.theory.certificates.region import margin_region
from orchestration.theory.certificates.timeline import LoopTimeline, _moves
from orchestration.theory.certificates.verify_certificate import verified
from orchestration.theory.stability import delay_bounds
from orchestration.theory.stability.delay_bounds import breaking_jitter
from quadcosim import Timing
from tests.examples.common import native_example as example
from tests.extent import in_test_all, sample
from tests.native import native
from tests.orchestration.experiments.studies.common import one_line
from tests.orchestration.quadrotor.flight.test_margin import DOUBLE
from tests.places import EXAMPLES

COMMAND, SAMPLE = "connections.command.delay_jitter", "components.controller.sampling.jitter"
LOST = "connections.command.loss"


@pytest.fixture(scope="module")
def system() -> System:
    """A double integrator under u = -x - v, sampled every second."""
    return changed(example("double_integrator"), {"components.controller.sampling.period": 1.0})


@pytest.fixture(scope="module")
def found(system: System) -> Certified:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(certificates, "SHARES", (0.95,))
        return margin(system, COMMAND)


def test_nearly_all_that_does_not_break_a_double_integrator_is_certified(found: Certified) -> None:
    loop = delay_bounds.SampledLoop(**DOUBLE, period=1.0)
    broken = breaking_jitter(loop, 1.0)
    assert broken is not None
    assert found.breaking == pytest.approx(broken[0], rel=1e-3)
    assert found.certified is not None
    assert found.certified == pytest.approx(0.95 * broken[0], rel=1e-3)
    assert found.small_gain == pytest.approx(delay_bounds.certain_jitter(loop), rel=1e-6)
    assert found.small_gain < found.certified
    assert found.states == 3


def test_the_sequence_that_breaks_a_loop_breaks_it_in_another_description(found: Certified) -> None:
    loop = delay_bounds.SampledLoop(**DOUBLE, period=1.0)
    late = [1.001 * value for _, (value,) in found.breaking_sequence]
    assert delay_bounds._radius(loop, late) > 1.0
    assert delay_bounds._radius(loop, [0.99 * value for value in late]) < 1.0


def test_a_certificate_is_of_its_own_system_and_of_no_other(
    system: System, found: Certified, tmp_path: Path
) -> None:  # fmt: skip
    path = found.save(tmp_path / "certificate.json")
    assert check_certificate(path).of == ()
    own = check_certificate(path, system)
    assert own.of == (COMMAND,)
    assert own.ranges == {"late": ((0.0, found.certified),)}
    slower = changed(system, {"components.controller.sampling.period": 1.01})
    with pytest.raises(
        UsageError, match=r"certificate.json: it is of a loop with a period of 1 s, the system has 1\.01 "
    ):
        check_certificate(path, slower)
    with pytest.raises(UsageError, match=r"in a period of the system other events come, or at other times"):
        check_certificate(path, changed(system, {"connections.command.delay": 0.01}))
    with pytest.raises(
        UsageError, match=r"certificate.json is of another system: connections.command.delay_jitter: exp"
    ):
        check_certificate(path, example("four_components"))
    with pytest.raises(UsageError, match="controller samples: the system's matrix is farther"):
        check_certificate(path, changed(system, {"connections.command.scale": 1.00001}))


def test_a_valid_proof_of_altered_matrices_is_refused_against_the_system(
    system: System, found: Certified, tmp_path: Path
) -> None:
    assert found.certificate is not None
    document = json.loads(found.certificate)
    *held, command = document["matrices"]["controller samples"]
    document["matrices"]["controller samples"] = [*held, [0.99999 * x for x in command]]
    path = tmp_path / "altered.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    assert check_certificate(path).states == 3
    with pytest.raises(UsageError, match="farther from the certificate's than the proof covers"):
        check_certificate(path, system)


def test_a_range_ends_where_it_is_told_to(system: System) -> None:
    brisk = changed(system, {"components.controller.sampling.period": 0.2})
    assert "up to 1 in a row, the most that is tried, that breaks the loop" in margin(brisk, LOST, last=1).verdict
    with pytest.raises(UsageError, match="last = 17: expected a number of losses in a row, from 1 to 16"):
        margin(brisk, LOST, last=17)
    with pytest.raises(
        UsageError, match="last = 2: expected above 0, and at most 1 s; beyond, two draws would be open"
    ):
        margin(system, COMMAND, last=2)


def test_of_a_loop_too_large_for_a_proof_only_what_breaks_it_is_sought(
    system: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(certificates, "MOST_STATES", 1)
    found = margin(system, LOST, last=3)
    assert found.certified is None
    assert found.breaking == 1
    assert "no proof sought: 3 states act on one another" in found.verdict
    late = margin(system, COMMAND, last=0.01)
    assert (late.certified, late.breaking) == (None, None)
    assert "no proof sought: 3 states act on one another" in late.verdict
    with pytest.raises(UsageError, match="no proof is sought: 2 states"):
        margin_region(system, COMMAND, SAMPLE)


def test_a_certificate_of_another_quantity_is_refused(system: System, found: Certified, tmp_path: Path) -> None:
    assert found.certificate is not None
    path = tmp_path / "other.json"
    for of in ([SAMPLE], [LOST], [COMMAND, SAMPLE]):
        path.write_text(json.dumps(json.loads(found.certificate) | {"of": of}), encoding="utf-8")
        with pytest.raises(UsageError, match=r"other quantities vary|other events come"):
            check_certificate(path, system)


@pytest.mark.parametrize("path", [LOST, "connections.measurement.loss"])
def test_runs_of_losses_are_certified_up_to_the_one_that_breaks(system: System, tmp_path: Path, path: str) -> None:
    faster = changed(system, {"components.controller.sampling.period": 0.8})
    lost = margin(faster, path)
    assert (lost.certified, lost.breaking) == (1, 2)
    assert [name for name, _ in lost.breaking_sequence] == ["lost", "lost", "arrives"]
    proof = check_certificate(lost.save(tmp_path / "lost.json"), faster)
    assert proof.runs == {"arrives": None, "lost": 1}


def of_losses(run: int, *pieces: tuple[Floats, Floats]) -> LoopFamily:
    """Messages that arrive or are lost, with a map of each, in the pieces of a period; at most `run` lost in a row."""
    matrices, letters = dict[str, Floats](), list[Letter]()
    for piece, maps in enumerate(pieces):
        for name, M, moves in zip(("arrives", "lost"), maps, _moves((piece, len(pieces)), run)):
            matrices[f"{name} {piece}"] = M
            letters.append(Letter(name=f"{name} {piece}", moves=moves, product=(Factor(matrix=f"{name} {piece}"),)))
    return LoopFamily(matrices=matrices, kept=tuple(range(len(pieces[0][0]))), letters=tuple(letters))


def test_a_loss_that_breaks_a_loop_only_after_several_arrivals_is_found() -> None:
    """A state goes around five places; where a message is lost, only what is at the first one goes on, tripled."""
    turn = np.roll(np.eye(5), 1, axis=0)
    family = of_losses(1, (0.9 * turn, 3.0 * turn @ np.diag([1.0, 0.0, 0.0, 0.0, 0.0])))
    broken = breaking_losses(family, 1)
    assert broken is not None
    assert [name for name, _ in broken.sequence] == ["lost 0", *["arrives 0"] * 4]
    assert (broken.value, broken.radius) == (1, pytest.approx(3.0 * 0.9**4))


def test_losses_in_each_message_of_a_period_grow_as_in_all_short_sequences() -> None:
    random = np.random.default_rng(3)
    (a, b, c, d) = random.normal(size=(4, 3, 3))
    family = of_losses(1, (a, b), (c, d))
    found, other = breaking_losses(family, 1), breaking_at(family, 1)
    assert found is not None
    assert other is not None
    word = [family.matrices[name] for name, _ in found.sequence]
    product = functools.reduce(lambda total, M: M @ total, word, np.eye(3))
    assert np.abs(np.linalg.eigvals(product)).max() == pytest.approx(found.radius)
    assert [int(name[-1]) for name, _ in found.sequence] in ([0, 1] * (len(word) // 2), [1, 0] * (len(word) // 2))
    assert found.radius ** (1 / len(word)) >= other.radius ** (1 / len(other.sequence)) * (1.0 - 1e-9)


def test_a_small_gain_bound_beyond_what_is_certified_is_in_the_verdict() -> None:
    """Certificates end at a period."""
    found = Certified(of=COMMAND, certified=0.01, largest=0.01, small_gain=0.047, searched="", states=5)
    best = "up to 47 ms is stable by the small-gain bound, without a certificate; every sequence up to 10 ms is stable"
    assert found.verdict.startswith(f"{COMMAND}: {best}, ")
    assert "small-gain" not in replace(found, small_gain=0.009).verdict


def test_a_proved_value_is_said_to_the_nanosecond() -> None:
    """A range ends before a period, 20 ms, which is not proved."""
    found = Certified(of=COMMAND, certified=0.019999999, largest=0.019999999, searched="", states=5)
    assert "every sequence up to 19.999999 ms is stable, none found up to 19.999999 ms, the most" in found.verdict


def test_a_value_of_the_file_beyond_what_is_certified_is_in_the_verdict() -> None:
    found = Certified(of=COMMAND, certified=0.001, largest=0.01, searched="", states=5, own=0.0012)
    less = "every sequence up to 1 ms is stable, less than the file's 1.2 ms, for which nothing is proved"
    assert f"{less} (no sign that it is unstable), none found" in found.verdict
    assert f"{less}, one of 1.1 ms breaks the loop" in replace(found, breaking=0.0011).verdict
    in_vain = replace(found, unproved=0.0011).verdict
    assert f"{less} (no sign that it is unstable); no proof was found for 1.1 ms, none found" in in_vain
    assert "the file's" not in replace(found, own=0.001).verdict
    assert certificates.highest_at(changed(example("double_integrator"), {COMMAND: 0.002}), COMMAND) == 0.002


def test_a_loop_that_is_unstable_by_itself_has_no_margin(system: System) -> None:
    slow = changed(system, {"components.controller.sampling.period": 2.1})
    for path in (COMMAND, LOST):
        none = margin(slow, path)
        assert (none.certified, none.breaking, none.certificate) == (None, 0, None)


def test_two_at_once_leave_less_of_each(system: System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(regions, "SHARES", (0.2,))
    monkeypatch.setattr(regions, "LONGEST_SEQUENCE", 2)
    both = margin_region(system, SAMPLE, COMMAND, columns=2)
    (_, alone), (late, beside) = both.certified
    assert late > 0.0
    assert beside < alone
    assert [good for _, good in both.certified] == pytest.approx([0.2 * bad for _, bad in both.breaking], rel=1e-6)
    *proofs, figure = both.save(tmp_path)
    assert check_certificate(proofs[1], system).ranges == {"late": ((0.0, late), (0.0, beside))}
    assert figure.stat().st_size > 1000


def test_what_it_is_not_for_is_refused(system: System) -> None:
    with pytest.raises(UsageError, match=r"expected a quantity that varies, as connections\.command\.delay_jitter"):
        margin(system, "connections.command.delay")
    with pytest.raises(UsageError, match=r"expected connections\.NAME\.delay_jitter"):
        margin(system, "stop_time")
    with pytest.raises(UsageError, match="expected two different"):
        margin_region(system, COMMAND, COMMAND)


# -- the quadrotor about hover ---------------------------------------------------------------------------------------


@functools.cache
def hover(period: float) -> CertifiedLoop:
    return linear_loop_of(native(timing=Timing(period=period)))


def command_of(period: float) -> tuple[LoopTimeline, Any]:
    varying = varying_of(native(), COMMAND)
    return LoopTimeline(hover(period), [varying]), varying


@pytest.mark.parametrize(("period", "breaking", "step"), sample([(0.04, 0.02823, 1), (0.06, 0.0200, 0)], 1))
def test_95_percent_of_what_breaks_hover_is_certified_for_all_axes(period: float, breaking: float, step: int) -> None:
    timeline, varying = command_of(period)
    most = round(0.95 * breaking, 6)
    family = timeline.family([most])
    assert [len(part) for part in parts_of(family)] == [5, 5, 3, 3]
    proof = find_certificate(family, [COMMAND], step)
    assert proof is not None
    assert verified(proof.certificate).ranges == {"late": ((0.0, most),)}
    assert breaking_at(timeline.family([0.999 * breaking]), 0.0) is None
    assert breaking_at(timeline.family([1.001 * breaking]), 0.0) is not None
    assert small_gain(timeline.loop, varying) == pytest.approx({0.04: 0.00935, 0.06: 0.00153}[period], abs=1e-5)


@in_test_all
def test_two_at_once_about_hover() -> None:
    """Samples up to 4 ms late and commands up to 23.87 ms, at 40 ms."""
    both = [varying_of(native(), path) for path in (SAMPLE, COMMAND)]
    proof = find_certificate(LoopTimeline(hover(0.04), both).family([0.004, 0.02387]), [SAMPLE, COMMAND])
    assert proof is not None
    assert sorted(high for ranges in verified(proof.certificate).ranges.values() for _, high in ranges) == [
        0.004,
        0.02387,
    ]


def test_losses_about_hover() -> None:
    timeline = LoopTimeline(hover(0.04), [varying_of(native(), LOST)])
    assert find_certificate(timeline.family(run=1), [LOST]) is not None
    broken = breaking_losses(timeline.family(run=2), 2)
    assert broken is not None
    assert [name for name, _ in broken.sequence] == ["lost", "lost", "arrives"]


def test_within_what_is_certified_random_sequences_die_out() -> None:
    timeline, _ = command_of(0.06)
    family = timeline.family([0.019])
    random = np.random.default_rng(2)
    maps = [family.at(family.letters[0], [0.019 * share]) for share in (0.0, 1.0, *random.uniform(size=6))]
    for most in (2, 8):
        late = random.integers(0, most, 800)
        assert np.linalg.norm(functools.reduce(lambda x, i: maps[i] @ x, late, np.ones(16))) < 1e-4


# -- the command -----------------------------------------------------------------------------------------------------


def output_of(capsys: pytest.CaptureFixture[str], *arguments: str | Path, code: int = 0) -> str:
    with pytest.raises(SystemExit) as ended:
        main([*map(str, arguments)])
    captured = capsys.readouterr()
    assert (ended.value.code or 0) == code, captured.err
    return captured.err if code else captured.out


def test_the_command_writes_what_it_checks(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(certificates, "SHARES", (0.95,))
    file = EXAMPLES / "double_integrator" / "system.toml"
    slow, other = (("--native", "--set", f"components.controller.sampling.period={period}") for period in (1.0, 0.9))
    path = tmp_path / "certificate.json"
    document = json.loads(output_of(capsys, "margin", file, *slow, "--of", COMMAND, "--out", path, "--json"))
    assert document["certified"] == pytest.approx(0.95 * document["breaking"], rel=1e-6)
    assert document["certificate"] == str(path)
    assert re.fullmatch(
        rf"{re.escape(COMMAND)}: every sequence up to \S+ ms is stable, "
        r"one of \S+ ms breaks the loop \(small deviations\)",
        document["verdict"],
    )
    text = output_of(capsys, "margin", "--check", path, file, *slow)
    late = f"0 s to {time_text(document['certified'])}, any number of times in a row"
    assert f"late               {late}" in text
    assert "connections.command.delay_jitter of this system" in text
    assert "no system was given" in output_of(capsys, "margin", "--check", path)
    assert "period of 1 s, the system has 900 ms" in one_line(
        output_of(capsys, "margin", "--check", path, file, *other, code=2)
    )


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        (["--and", COMMAND], "--and: expected --of PATH beside it"),
        (["--out", "x.json"], "--out: expected --of PATH beside it"),
        (["--check", "x.json", "--of", COMMAND], "--check: expected neither --of nor --out"),
        (["--check", "x.json"], "x.json: expected a readable certificate"),
        (["--of", "connections.command.delay"], "--of connections.command.delay: expected a quantity that varies"),
    ],
)
def test_flags_that_do_not_go_together_are_refused_in_a_line(
    capsys: pytest.CaptureFixture[str], flags: list[str], expected: str
) -> None:
    assert expected in one_line(output_of(capsys, "margin", *flags, code=2))


def test_a_missing_package_is_said_with_its_extra(monkeypatch: pytest.MonkeyPatch, system: System) -> None:
    import importlib.util

    usual = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "flint" else usual(name))
    with pytest.raises(QuadcosimError, match=r"pip install 'quadcosim\[certificates\]'"):
        margin(system, COMMAND)
