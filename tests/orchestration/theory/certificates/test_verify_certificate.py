"""What the checker takes for a proof: against loops whose stability is known, and against files that were altered."""

import dataclasses
import functools
import itertools
import json
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import arb, arb_mat

from orchestration.foundation.basics.errors import UsageError
from orchestration.theory.certificates import verify_certificate
from orchestration.theory.certificates.breaking import least_breaking
from orchestration.theory.certificates.certificate import Certificate, read_certificate
from orchestration.theory.certificates.certified_loop import LOSS, Varying
from orchestration.theory.certificates.check_file import AnotherLoop, expect_same_family
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.find_certificate import find_certificate
from orchestration.theory.certificates.timeline import LoopTimeline
from orchestration.theory.certificates.verify_certificate import NotProven, is_positive, verified
from tests.orchestration.theory.certificates.loops import (
    HOVER_A,
    HOVER_B,
    HOVER_F,
    cart_under_lqg,
    certificate_of,
    late_command,
    switched,
)

ROTATION = 0.999 * np.array([[math.cos(0.3), -math.sin(0.3)], [math.sin(0.3), math.cos(0.3)]])


@pytest.fixture(scope="module")
def hover() -> Certificate:
    """95 % of what breaks a lateral axis at 60 ms."""
    found = find_certificate(late_command(HOVER_A, HOVER_B, HOVER_F, 0.06, 0.019), ["here"])
    assert found is not None
    return found.certificate


def test_a_form_that_falls_for_every_letter_is_a_proof() -> None:
    assert verified(certificate_of(switched(ROTATION, ROTATION.T), np.eye(2))).states == 2


def test_a_form_that_falls_by_rounding_only_is_none() -> None:
    exact = switched(np.eye(2))
    with pytest.raises(NotProven, match="does not fall"):
        verified(certificate_of(exact, np.eye(2)))


def test_a_form_that_is_not_symmetric_to_the_bit_is_none() -> None:
    form = np.eye(2)
    form[0, 1] = 1e-300
    with pytest.raises(NotProven, match="not symmetric"):
        verified(certificate_of(switched(ROTATION), form))


def test_an_indefinite_form_that_falls_is_none() -> None:
    with pytest.raises(NotProven, match="not positive definite"):
        verified(certificate_of(switched(2.0 * np.eye(2)), -np.eye(2)))


def test_every_word_and_mode_needs_a_form(hover: Certificate) -> None:
    longer = dataclasses.replace(hover, memory=hover.memory + 1)
    with pytest.raises(NotProven, match="no form for"):
        verified(longer)


@pytest.mark.parametrize("cell", [(0.0, 0.004), (0.011, 0.019)])
def test_a_cell_holds_every_map_of_it(hover: Certificate, cell: tuple[float, float]) -> None:
    """Between the corners, each as wide as it is, lies the map in the coordinates of the forms."""
    letter, X = hover.family.letters[0], hover.coordinates
    exact = dataclasses.replace(hover, radius=0.0)
    low, high = (np.array(c.tolist()) for c in verify_certificate._Enclosures(exact)._corners(letter, (cell,)))
    for share in np.linspace(0.0, 1.0, 21):
        M = X @ hover.family.at(letter, [cell[0] + share * (cell[1] - cell[0])]) @ np.linalg.inv(X)
        line = (1.0 - share) * low + share * high
        assert all(abs(x - y.mid()) <= y.rad() + arb(1e-9) for x, y in zip(M.ravel().tolist(), line.ravel()))
    middle = X @ hover.family.at(letter, [0.5 * sum(cell)]) @ np.linalg.inv(X)
    bent = np.abs(middle - np.vectorize(lambda a, b: float(((a + b) / 2).mid()))(low, high))
    wide = np.vectorize(lambda a: float(a.rad()))(low)
    assert bent.max() > 0.2 * wide.max()  # not many times as wide as it needs to be


def test_the_proof_covers_what_was_measured_to_1e_6_and_not_to_1e_2(hover: Certificate) -> None:
    assert verified(hover).radius == 1e-6
    with pytest.raises(NotProven):
        verified(dataclasses.replace(hover, radius=1e-2))


def test_within_the_radius_every_loop_is_stable(hover: Certificate) -> None:
    random = np.random.default_rng(3)
    matrices = {
        name: m + 1e-6 * np.abs(m).max(axis=1, keepdims=True) * random.uniform(-1, 1, m.shape) * (m != 0.0)
        for name, m in hover.family.matrices.items()
    }
    moved = dataclasses.replace(hover, radius=0.0, family=dataclasses.replace(hover.family, matrices=matrices))
    assert verified(moved).radius == 0.0


def test_what_is_said_is_made_of_the_numbers(hover: Certificate) -> None:
    document = json.loads(hover.to_json())
    letter = document["letters"][0]
    letter["edges"], letter["labels"] = [letter["edges"][0][:-4]], letter["labels"][:-4]
    shrunk = verified(_read(document)).ranges["late"][0]
    assert verified(hover).ranges == {"late": ((0.0, 0.019),)}
    assert shrunk == (0.0, letter["edges"][0][-1])
    assert shrunk[1] < 0.019


def test_positive_is_what_every_matrix_between_the_entries_is() -> None:
    """1 on the diagonal and ±r beside it, 8 by 8: positive definite up to r = 1/7."""
    for r, positive in ((0.142, True), (0.143, False)):
        beside = [[arb(1) if i == j else arb(0, r) for j in range(8)] for i in range(8)]
        assert is_positive(arb_mat(beside)) is positive


def test_lqg_is_certified_in_a_state_that_leaves_the_radius_room() -> None:
    lost = Varying(kind=LOSS, name="command", path="connections.command.loss")
    family = LoopTimeline(cart_under_lqg(), [lost]).family(run=4)
    found = find_certificate(family, [lost.path])
    assert found is not None
    proof = found.certificate
    assert verified(proof).runs == {"arrives": None, "lost": 4}
    assert proof.radius == 1e-6
    again = _read(json.loads(proof.to_json()))
    expect_same_family(again, family)
    assert again.basis is not None
    mixed = again.basis.copy()
    mixed[0, -1] = 1.0  # a state of the plant with one of the law
    for basis in (mixed, np.zeros_like(mixed), mixed[1:, 1:], None):
        with pytest.raises(AnotherLoop):
            expect_same_family(dataclasses.replace(again, basis=basis), family)


def _read(document: Any) -> Certificate:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "certificate.json"
        path.write_text(json.dumps(document), encoding="utf-8")
        return read_certificate(path)


def test_a_certificate_comes_back_from_its_file_as_it_was(hover: Certificate) -> None:
    again = _read(json.loads(hover.to_json()))
    assert again.to_json() == hover.to_json()
    assert verified(again) == verified(hover)


ALTERED: dict[str, Callable[[dict[str, Any]], Any]] = {
    "longer": lambda d: d["letters"][0]["edges"][0].__setitem__(-1, 0.0205),
    "an entry of a form": lambda d: d["forms"][0]["form"][0].__setitem__(0, -d["forms"][0]["form"][0][0]),
    "a gain": lambda d: d["matrices"]["sample"][5].__setitem__(0, 1.3 * d["matrices"]["sample"][5][0]),
    "coordinates": lambda d: d["coordinates"].__setitem__(0, d["coordinates"][1]),
    "no forms": lambda d: d.__setitem__("forms", []),
}


@pytest.mark.parametrize("change", ALTERED.values(), ids=ALTERED)
def test_an_altered_certificate_is_rejected(hover: Certificate, change: Callable[[dict[str, Any]], Any]) -> None:
    document = json.loads(hover.to_json())
    change(document)
    with pytest.raises(NotProven):
        verified(_read(document))


MALFORMED: dict[str, Callable[[dict[str, Any]], Any]] = {
    "another format": lambda d: d.__setitem__("format", "a poem"),
    "edges that go back": lambda d: d["letters"][0]["edges"][0].reverse(),
    "too few labels": lambda d: d["letters"][0]["labels"].pop(),
    "a matrix that is none": lambda d: d["matrices"]["flow"].pop(),
    "no number": lambda d: d.__setitem__("radius", "small"),
    "a factor of nothing": lambda d: d["letters"][0]["product"].append(["nothing"]),
    "a label of two letters": lambda d: d["letters"].append(d["letters"][0]),
    "not finite": lambda d: d["coordinates"][0].__setitem__(0, math.inf),
    "a negative radius": lambda d: d.__setitem__("radius", -1.0),
}


@pytest.mark.parametrize("change", MALFORMED.values(), ids=MALFORMED)
def test_what_is_no_certificate_is_refused(hover: Certificate, change: Callable[[dict[str, Any]], Any]) -> None:
    document = json.loads(hover.to_json())
    change(document)
    with pytest.raises(UsageError, match="expected a certificate"):
        _read(document)


# -- never for a loop that is unstable -------------------------------------------------------------------------------


def unstable(seed: int) -> LoopFamily:
    """Two random matrices, each stable by itself, of which a product of a few is not, by construction just so."""
    random = np.random.default_rng(seed)
    pair = [random.normal(size=(3, 3)) for _ in range(2)]
    pair = [m / np.abs(np.linalg.eigvals(m)).max() for m in pair]
    words = [word for length in range(1, 7) for word in itertools.product((0, 1), repeat=length)]
    products = [functools.reduce(np.matmul, [pair[i] for i in word]) for word in words]
    worst = max(np.abs(np.linalg.eigvals(p)).max() ** (1.0 / len(word)) for word, p in zip(words, products))
    return switched(*[m * 1.001 / worst for m in pair])


@pytest.mark.parametrize("seed", range(4))
def test_none_is_given_for_a_loop_that_is_unstable_by_construction(seed: int) -> None:
    assert find_certificate(unstable(seed), ["here"]) is None


def test_what_lies_close_below_has_one() -> None:
    """The same loops, 5 % smaller: forms that depend on what comes next leave that little open."""
    family = unstable(0)
    smaller = switched(*[0.95 * m for m in family.matrices.values()])
    found = find_certificate(smaller, ["here"])
    assert found is not None
    assert verified(found.certificate).runs == {"m0": None, "m1": None}


def test_of_an_integrator_all_but_the_last_of_what_breaks_it_is_certified() -> None:
    """x' = u, u = -1.5 x of each second: late and at once in turn is too much first."""

    def up_to(jitter: float) -> LoopFamily:
        return late_command(np.zeros((1, 1)), np.ones((1, 1)), np.array([[-1.5]]), 1.0, jitter)

    broken = least_breaking(up_to, 1.0)
    assert broken is not None
    turns = [point for _, (point,) in broken.sequence]
    assert sorted(turns) == [0.0, broken.value]
    assert find_certificate(up_to(0.97 * broken.value), ["here"]) is not None
    assert find_certificate(up_to(1.001 * broken.value), ["here"]) is None
