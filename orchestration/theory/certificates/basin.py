"""A set of initial states from which a loop with a limited command is proved to come to rest, even with large errors.

The plant and the law are linear, without memory in the law, and each signal of the command is cut to ±limit. Where
|H z| ≤ limit, the cut value of F z lies between F z and H z, for any H (T. Hu, Z. Lin, Control Systems with Actuator
Saturation, 2001). So a form that falls for both commands, in every combination of the signals, falls for the cut one in
the set zᵀPz ≤ 1, as long as |H z| ≤ limit there: states in it stay in it, and decay. P and H are found by semidefinite
programming and proved by the checker of certificates, in ball arithmetic.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from flint import arb_mat, ctx

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import needs
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.theory.certificates.certificate import Cells, Certificate
from orchestration.theory.certificates.certified_loop import LOSS, Varying
from orchestration.theory.certificates.family import Factor, Letter, LoopFamily
from orchestration.theory.certificates.find_certificate import RADIUS, least_cost
from orchestration.theory.certificates.margin import linear_loop_of
from orchestration.theory.certificates.timeline import LoopTimeline
from orchestration.theory.certificates.verify_certificate import BITS, NotProven, verified

FALL = 1e-4
"""Share by which a form falls at least; it covers the radius of measured matrices"""
MOST_SIGNALS = 3
"""Most signals of a command"""


@dataclass(frozen=True, kw_only=True)
class Basin:
    """The set zᵀPz ≤ 1 of states of a loop just before a sample: from each of them the loop comes to rest."""

    P: Floats
    """The form."""
    H: Floats
    """The auxiliary command, by signal: it stays within the limit in the set."""
    limit: float
    """Bound to which each signal of the command is cut, both ways."""
    certificate: str
    """The proof that the form falls, as the text of a file that `check` verifies."""

    @property
    def reach(self) -> Floats:
        """The extent of the set along each coordinate, the others at 0."""
        return 1.0 / np.sqrt(np.diag(self.P))


@needs("flint", "clarabel")
def basin(request: RequestLike, connection: str, limit: float) -> Basin:
    """A proved basin of a system's loop about its operating point, if each signal of a connection is cut to ±`limit`.

    The loop is otherwise linear, without jitter, and has one sampled component, which has no memory. The limit applies
    to the deviation from the command at the operating point. The set is the one provable by this method whose least
    extent along a coordinate is largest.

    Raises `UsageError` for another loop, and for one without a basin found.
    """
    if not limit > 0.0:
        raise UsageError(f"limit {limit:g}: expected a positive number")
    request = request_of(request)
    loop = linear_loop_of(request)
    sampled = [name for name in loop.components if loop.is_sampled(name)]
    sent = [x.name for x in loop.system.connections if x.sender in sampled]
    if len(sampled) != 1 or len(loop.components[sampled[0]].A) or sent != [connection]:
        raise UsageError(f"{connection}: expected the connection from the only sampled component, which has no memory")
    return largest_basin(LoopTimeline(loop, [Varying(kind=LOSS, name=connection, path=connection)]).family(), limit)


def largest_basin(family: LoopFamily, limit: float) -> Basin:
    """The basin of a family of one letter, whose first factor computes the command in the rows that copy no value."""
    (letter,) = family.letters
    sample = family.matrices[letter.product[0].matrix]
    rows = [i for i, row in enumerate(sample) if [x for x in row if x] not in ([1.0], [])]
    signals = list(dict.fromkeys(tuple(sample[i].tolist()) for i in rows))
    if len(signals) > MOST_SIGNALS:
        raise UsageError(f"a command of {len(signals)} signals: expected at most {MOST_SIGNALS}")
    of_signal = [[i for i in rows if tuple(sample[i].tolist()) == signal] for signal in signals]
    P, H = _solve(family, of_signal, limit)
    certificate = _certificate(family, of_signal, P, H)
    verified(certificate)
    _expect_within(certificate.coordinates, H, limit)
    return Basin(P=P, H=H, limit=limit, certificate=certificate.to_json())


def _with_commands(family: LoopFamily, of_signal: Sequence[Sequence[int]], commands: Sequence[Floats | None]) -> Floats:
    """The first factor with other commands, by the kept coordinates; None: unchanged."""
    sample: Floats = family.matrices[family.letters[0].product[0].matrix].copy()
    for rows, command in zip(of_signal, commands):
        if command is not None:
            sample[rows] = 0.0
            sample[np.ix_(rows, family.kept)] = command
    return sample


def _solve(family: LoopFamily, of_signal: Sequence[Sequence[int]], limit: float) -> tuple[Floats, Floats]:
    """P and H, by Q = P⁻¹ and Y = H Q."""
    n, m, letter = len(family.kept), len(of_signal), family.letters[0]
    name = letter.product[0].matrix

    def at(commands: Sequence[Floats]) -> Floats:
        return replace(family, matrices={**family.matrices, name: _with_commands(family, of_signal, commands)}).at(
            letter
        )

    nothing = [np.zeros(n)] * m
    without = at(nothing)
    effect = np.column_stack([(at([*nothing[:i], np.eye(n)[0], *nothing[i + 1 :]]) - without)[:, 0] for i in range(m)])
    gains = family.matrices[name][np.ix_([rows[0] for rows in of_signal], family.kept)]
    count = n * (n + 1) // 2
    upper = np.triu_indices(n)

    def unpacked(x: Floats) -> tuple[Floats, Floats]:
        Q = np.zeros((n, n))
        Q[upper] = x[:count]
        return Q + np.triu(Q, 1).T, x[count : count + m * n].reshape(m, n)

    def falls(x: Floats, cut: Sequence[bool]) -> Floats:
        Q, Y = unpacked(x)
        after = without @ Q + effect @ np.where(np.array(cut)[:, None], Y, gains @ Q)
        return np.block([[(1.0 - FALL) * Q, after.T], [after, Q]])

    def stays(x: Floats, i: int) -> Floats:
        Q, Y = unpacked(x)
        return np.block([[np.full((1, 1), (1.0 - FALL) * limit**2), Y[i : i + 1]], [Y[i : i + 1].T, Q]])

    def reaches(x: Floats, i: int) -> Floats:
        Q, _ = unpacked(x)
        r = np.eye(n)[:, i : i + 1]
        return np.block([[np.full((1, 1), x[-1]), r.T], [r, Q]])

    conditions = [lambda x, cut=cut: falls(x, cut) for cut in itertools.product((False, True), repeat=m)]
    conditions += [lambda x, i=i: stays(x, i) for i in range(m)]
    conditions += [lambda x, i=i: reaches(x, i) for i in range(n)]
    x = least_cost(conditions, count + m * n + 1)
    if x is None:
        raise UsageError("no basin was found; is the loop unstable?")
    Q, Y = unpacked(x)
    P = np.linalg.inv(Q)
    return 0.5 * (P + P.T), Y @ P


def _certificate(family: LoopFamily, of_signal: Sequence[Sequence[int]], P: Floats, H: Floats) -> Certificate:
    """The certificate that the form falls for every combination of commands."""
    letter = family.letters[0]
    first, *rest = letter.product
    matrices, letters = dict(family.matrices), []
    for cut in itertools.product((False, True), repeat=len(of_signal)):
        name = (
            first.matrix
            if not any(cut)
            else f"{first.matrix}, cut {'+'.join(str(i + 1) for i in range(len(cut)) if cut[i])}"
        )
        matrices[name] = _with_commands(family, of_signal, [h if c else None for h, c in zip(H, cut)])
        letters.append(Letter(name=name, product=(Factor(matrix=name), *rest)))
    return Certificate(
        of=(), radius=RADIUS, family=LoopFamily(matrices=matrices, kept=family.kept, letters=tuple(letters)),
        cells=tuple(Cells(edges=(), labels=(i,)) for i in range(len(letters))),
        coordinates=np.linalg.cholesky(P).T, memory=0, forms={(0, ()): np.eye(len(P))},
    )  # fmt: skip


def _expect_within(coordinates: Floats, H: Floats, limit: float) -> None:
    """Raise `NotProven` where |H z| may be more than the limit for |coordinates · z| ≤ 1."""
    before, ctx.prec = ctx.prec, BITS
    try:
        by_form = arb_mat(H.tolist()) * arb_mat(coordinates.tolist()).inv()
        if not all(sum(x * x for x in row) <= limit**2 for row in by_form.tolist()):
            raise NotProven("the auxiliary command may exceed the limit")
    finally:
        ctx.prec = before
