"""Verifies a certificate independently, in ball arithmetic: every number below is an interval with the true one.

Proved is: V(mode, word, z) = zᵀ P(mode, word) z, where the word consists of the labels of future values, falls from one
period to the next, for any next letter and any values of its parameters:

    M(τ)ᵀ P(next mode, next word) M(τ) < P(mode, word)    for all τ in the cells of the word's first label.

M(τ) over a cell lies between its values at the corners of the cell, but for r²/2 · sup |∂²M/∂τ²| along each parameter,
r half of the cell's width; and MᵀPM is convex in M, so the corners suffice. The forms may be given in any coordinates
X of the state: the tested matrices are congruent to the above. Nothing here depends on how the forms were found.
"""

import itertools
from collections.abc import Iterator

from flint import arb, arb_mat, ctx

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.certificates.certificate import Box, Certificate, Checked, Node, words
from orchestration.theory.certificates.family import Factor, Letter

BITS = 106
"""Bits of the arithmetic"""
OF_THE_LARGEST = 1e-3
"""Share of the largest entry of a row that is added to the radius for the others"""


class NotProven(QuadcosimError):
    """The numbers of a certificate do not prove anything."""


def verified(certificate: Certificate) -> Checked:
    """Verify `certificate`: what it proves; raises `NotProven` where it proves nothing."""
    before, ctx.prec = ctx.prec, BITS
    try:
        forms = _forms(certificate)
        enclosures = _Enclosures(certificate)
        for edge in edges_of(certificate):
            _expect_fall(edge, forms, enclosures)
    finally:
        ctx.prec = before
    letters = certificate.family.letters
    return Checked(
        ranges={letter.name: letter.ranges for letter in letters},
        runs={letter.name: _longest_run(letter) for letter in letters},
        states=len(certificate.family.kept),
        radius=certificate.radius,
    )


def _forms(certificate: Certificate) -> dict[Node, arb_mat]:
    """The forms of all modes and words, each symmetric to the bit and positive definite."""
    modes = {mode for letter in certificate.family.letters for move in letter.moves for mode in move}
    nodes = {(mode, word) for mode in modes for _, word in words(certificate, mode, certificate.memory)}
    found = {}
    for node in nodes:
        form = certificate.forms.get(node)
        if form is None:
            raise NotProven(f"no form for mode {node[0]} and word {list(node[1])}")
        if not (form == form.T).all():
            raise NotProven(f"the form of mode {node[0]} and word {list(node[1])} is not symmetric")
        found[node] = arb_mat(form.tolist())
        if not is_positive(found[node]):
            raise NotProven(f"the form of mode {node[0]} and word {list(node[1])} is not positive definite")
    return found


def edges_of(certificate: Certificate) -> Iterator[tuple[Node, Node, int]]:
    """Every node, each node that may follow it, and the label in between."""
    modes = {mode for letter in certificate.family.letters for move in letter.moves for mode in move}
    for mode in sorted(modes):
        for after, longer in words(certificate, mode, certificate.memory + 1):
            yield (mode, longer[:-1]), (after, longer[1:]), longer[0]


def _expect_fall(edge: tuple[Node, Node, int], forms: dict[Node, arb_mat], enclosures: "_Enclosures") -> None:
    start, end, label = edge
    for box, corners in enclosures.of(label):
        for M in corners:
            if not is_positive(forms[start] - M.transpose() * forms[end] * M):
                raise NotProven(f"the form does not fall for {_cell_text(enclosures.letter_of(label), box)}")


class _Enclosures:
    """Enclosures of the maps over cells."""

    def __init__(self, certificate: Certificate) -> None:
        self._certificate, family = certificate, certificate.family
        self._matrices = {name: _enclosed(m, certificate.radius) for name, m in family.matrices.items()}
        size, coordinates = len(next(iter(family.matrices.values()))), arb_mat(certificate.coordinates.tolist())
        chosen = arb_mat([[int(i == j) for j in range(size)] for i in family.kept])
        try:
            self._first = chosen.transpose() * coordinates.inv()
        except ZeroDivisionError:
            raise NotProven("the coordinates of the forms are not independent") from None
        self._last = coordinates * chosen
        self._factors: dict[tuple[Factor, Box], arb_mat] = {}
        self._products: dict[tuple[Factor, ...], list[Factor | arb_mat]] = {}
        self._known: dict[tuple[int, Box], list[arb_mat]] = {}

    def letter_of(self, label: int) -> Letter:
        pairs = zip(self._certificate.family.letters, self._certificate.cells)
        return next(letter for letter, cells in pairs if label in cells.labels)

    def of(self, label: int) -> Iterator[tuple[Box, list[arb_mat]]]:
        """The cells of a label, and for each the maps at its corners, widened to enclose the maps between them."""
        letter = self.letter_of(label)
        cells = self._certificate.cells[self._certificate.family.letters.index(letter)]
        for box in [box for other, box in cells.boxes() if other == label]:
            if (label, box) not in self._known:
                self._known[label, box] = self._corners(letter, box)
            yield box, self._known[label, box]

    def _corners(self, letter: Letter, box: Box) -> list[arb_mat]:
        beyond = None
        for i, (low, high) in enumerate(box):
            if low == high:
                continue
            bent = self._jet(letter, box, i)[2] * ((arb(high) - arb(low)) ** 2 / 8)
            beyond = bent if beyond is None else _sum_of_sizes(beyond, bent)
        corners = [self._map(letter, corner) for corner in dict.fromkeys(itertools.product(*box))]
        return corners if beyond is None else [_widened(M, beyond) for M in corners]

    def _map(self, letter: Letter, point: tuple[float, ...]) -> arb_mat:
        M = self._first
        for factor in self._joined(letter):
            M = (factor if isinstance(factor, arb_mat) else self._factor(factor, tuple((x, x) for x in point))) * M
        return self._last * M

    def _jet(self, letter: Letter, box: Box, along: int) -> tuple[arb_mat, arb_mat, arb_mat]:
        """The map over a box, and its first two derivatives along a parameter."""
        M = self._first
        d = dd = arb_mat(M.nrows(), M.ncols())
        for factor in self._joined(letter):
            F = factor if isinstance(factor, arb_mat) else self._factor(factor, box)
            M, d, dd = F * M, F * d, F * dd
            if isinstance(factor, Factor) and factor.times is not None and factor.times[along + 1] != 0.0:
                G = self._matrices[factor.matrix] * arb(factor.times[along + 1])
                dd, d = dd + G * d * 2 + G * (G * M), d + G * M
        return self._last * M, self._last * d, self._last * dd

    def _joined(self, letter: Letter) -> list[Factor | arb_mat]:
        """The factors of a letter, those between two that vary as one matrix."""
        if letter.product not in self._products:
            found: list[Factor | arb_mat] = []
            for factor in letter.product:
                if factor.times is not None and any(factor.times[1:]):
                    found.append(factor)
                    continue
                F = self._factor(factor, ((0.0, 0.0),) * len(letter.ranges))
                if found and isinstance(found[-1], arb_mat):
                    found[-1] = F * found[-1]
                else:
                    found.append(F)
            self._products[letter.product] = found
        return self._products[letter.product]

    def _factor(self, factor: Factor, box: Box) -> arb_mat:
        X = self._matrices[factor.matrix]
        if factor.times is None:
            return X
        if (factor, box) not in self._factors:
            lasts = arb(factor.times[0])
            for c, (low, high) in zip(factor.times[1:], box):
                lasts += arb(c) * arb(low).union(arb(high))
            self._factors[factor, box] = (X * lasts).exp()
        return self._factors[factor, box]


def _enclosed(matrix: Floats, radius: float) -> arb_mat:
    """A measured matrix with its error: `radius` of every entry, and a thousandth of that of the largest in its
    row.

    Zeros are exact, and so are rows with a single 1, which hold or copy a value.
    """
    return arb_mat([_enclosed_row(row.tolist(), radius) for row in matrix])


def _enclosed_row(row: list[float], radius: float) -> list[arb]:
    if [x for x in row if x != 0.0] == [1.0]:
        return [arb(x) for x in row]
    of_all = OF_THE_LARGEST * max(map(abs, row))
    return [arb(x, radius * (abs(x) + of_all)) if x != 0.0 else arb(0) for x in row]


def _sum_of_sizes(a: arb_mat, b: arb_mat) -> arb_mat:
    return arb_mat([[abs(x) + abs(y) for x, y in zip(p, q)] for p, q in zip(a.tolist(), b.tolist())])


def _widened(M: arb_mat, by: arb_mat) -> arb_mat:
    """The matrix with the sizes of the entries of `by` added as radii."""
    rows = zip(M.tolist(), by.tolist())
    return arb_mat([[x + arb(0, y.abs_upper()) for x, y in zip(p, q)] for p, q in rows])


def is_positive(Q: arb_mat) -> bool:
    """Whether every symmetric matrix in `Q` is positive definite.

    Where |E| <= R, E + diag(Σ R_ij v_j / v_i) is positive semidefinite for any v > 0: so it suffices that the matrix of
    the centres is, less that diagonal. In it only rounding is left, which its Cholesky factor survives; in intervals as
    wide as those of `Q` it would lose most of the room that there is.
    """
    rows = Q.tolist()
    if not all(rows[i][i] > 0 for i in range(len(rows))):
        return False
    v = [row[i].mid().sqrt().mid() for i, row in enumerate(rows)]
    centres = [[x.mid() for x in row] for row in rows]
    for i in range(len(rows)):
        off = sum((rows[max(i, j)][min(i, j)].rad() * v[j] for j in range(len(rows))), arb(0))
        centres[i][i] -= off / v[i]
    return _has_cholesky_factor(centres)


def _has_cholesky_factor(rows: list[list[arb]]) -> bool:
    """Whether a symmetric matrix has a Cholesky factor, in intervals."""
    lower = list[list[arb]]()
    for i, row in enumerate(rows):
        new: list[arb] = []
        for j in range(i):
            other = lower[j]
            x = row[j]
            for k in range(j):
                x -= new[k] * other[k]
            new.append(x / other[j])
        rest = row[i]
        for x in new:
            rest -= x * x
        if not rest > 0:
            return False
        lower.append([*new, rest.sqrt()])
    return True


def _longest_run(letter: Letter) -> int | None:
    """The largest number of moves of a letter in a row; None: any."""
    reached, count = {start for start, _ in letter.moves}, 0
    while reached and count <= len(letter.moves):
        reached, count = {end for start, end in letter.moves if start in reached}, count + 1
    return None if count > len(letter.moves) and reached else count - 1


def _cell_text(letter: Letter, box: Box) -> str:
    return " and ".join([letter.name, *(f"{low:.6g} to {high:.6g}" for low, high in box)])
