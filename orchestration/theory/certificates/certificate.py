"""A certificate: matrices, cells and quadratic forms, as a file that a checker verifies independently."""

import itertools
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestration.foundation.basics.documents import read_text
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import time_text
from orchestration.theory.certificates.family import Factor, Letter, LoopFamily

FORMAT = "quadcosim certificate 1"

Box = tuple[tuple[float, float], ...]
"""The ends of a cell along each parameter"""
Word = tuple[int, ...]
Node = tuple[int, Word]
"""A mode, and the labels of future values"""


@dataclass(frozen=True, kw_only=True)
class Cells:
    """The cells into which the values of a letter are divided."""

    edges: tuple[tuple[float, ...], ...]
    """Edges of the cells along each parameter, ascending"""
    labels: tuple[int, ...]
    """Labels of each cell, those of the last parameter next to each other"""

    def boxes(self) -> Iterator[tuple[int, Box]]:
        """The label of each cell, and its ends along each parameter."""
        sides = [list(itertools.pairwise(edges)) for edges in self.edges]
        yield from zip(self.labels, itertools.product(*sides), strict=True)


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """The proof, if the checker accepts it, that no sequence of letters makes a family grow."""

    of: tuple[str, ...]
    """paths of the quantities that vary in its system"""
    radius: float
    """relative, by row, of measured matrices: the proof covers all matrices within it"""
    family: LoopFamily
    cells: tuple[Cells, ...]
    """Cells of each letter; a label belongs to one letter"""
    coordinates: Floats
    """Coordinates of the forms, by the kept coordinates of the family"""
    memory: int
    """the number of future labels that a form depends on"""
    forms: Mapping[Node, Floats]
    basis: Floats | None = None
    """The state of `family` by that of its system; None: they are the same"""

    def to_json(self) -> str:
        """The file."""
        letters = [
            {
                "name": letter.name,
                "moves": letter.moves,
                "product": [[f.matrix, *(f.times or ())] for f in letter.product],
                "edges": cells.edges,
                "labels": cells.labels,
            }
            for letter, cells in zip(self.family.letters, self.cells)
        ]
        document = {
            "format": FORMAT,
            "of": self.of,
            "radius": self.radius,
            "matrices": {name: matrix.tolist() for name, matrix in self.family.matrices.items()},
            "kept": self.family.kept,
            "letters": letters,
            "basis": None if self.basis is None else self.basis.tolist(),
            "coordinates": self.coordinates.tolist(),
            "memory": self.memory,
            "forms": [{"mode": m, "word": w, "form": form.tolist()} for (m, w), form in self.forms.items()],
        }
        return json.dumps(document) + "\n"


@dataclass(frozen=True, kw_only=True)
class Checked:
    """What a certificate proves, from its numbers."""

    ranges: dict[str, tuple[tuple[float, float], ...]]
    """Ranges of the values of an event of a period, by its letter [s]."""
    runs: dict[str, int | None]
    """Number of times in a row that a letter may come; None: any number."""
    states: int
    """The size of the state from period to period."""
    radius: float
    """Relative: the proof covers all matrices within it."""
    of: tuple[str, ...] = ()
    """The paths that vary in the system that it was compared with; empty without a system."""
    up_to: float | None = None
    """Largest value of a path of a computer or a network [s] that delays the loop no more than these ranges."""

    @property
    def verdict(self) -> str:
        """What a certificate proves, and about what."""
        up_to = "" if self.up_to is None else f" from 0 to {time_text(self.up_to)}"
        whose = f"{' and '.join(self.of)}{up_to} of this system" if self.of else "the matrices in the file"
        return f"the proof holds for {whose}: no sequence makes the {self.states} numbers of the loop grow"


def words(certificate: Certificate, mode: int, length: int) -> Iterator[tuple[int, Word]]:
    """The words of labels of a length that may follow a mode, each with the mode that its first label leads to."""
    if length == 0:
        yield mode, ()
        return
    for letter, cells in zip(certificate.family.letters, certificate.cells):
        for start, end in letter.moves:
            if start == mode:
                for label in sorted(set(cells.labels)):
                    for rest in sorted({word for _, word in words(certificate, end, length - 1)}):
                        yield end, (label, *rest)


def read_certificate(path: Path) -> Certificate:
    """The certificate of a file; raises `UsageError` for a file that is none."""
    text = read_text(path, "certificate")
    try:
        found = _certificate(json.loads(text))
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise UsageError(f"{path}: expected a certificate as `quadcosim margin --out` writes it: {error!r}") from error
    return found


def _certificate(document: Mapping[str, Any]) -> Certificate:
    if document["format"] != FORMAT or document["radius"] < 0.0:
        raise ValueError(f"format {document['format']!r}, radius {document['radius']}")
    matrices = {str(name): _square(matrix) for name, matrix in document["matrices"].items()}
    size = len(next(iter(matrices.values())))
    letters, cells = [], []
    for each in document["letters"]:
        edges = tuple(tuple(map(_number, along)) for along in each["edges"])
        if any(len(e) < 2 or list(e) != sorted(e) for e in edges):
            raise ValueError("edges that do not ascend")
        cells.append(Cells(edges=edges, labels=tuple(map(_index, each["labels"]))))
        list(cells[-1].boxes())
        letters.append(
            Letter(
                name=str(each["name"]),
                moves=tuple((_index(a), _index(b)) for a, b in each["moves"]),
                product=tuple(_factor(each, matrices, len(edges)) for each in each["product"]),
                ranges=tuple((e[0], e[-1]) for e in edges),
            )
        )
    kept = tuple(map(_index, document["kept"]))
    if any(len(m) != size for m in matrices.values()) or len(set(kept)) != len(kept) or not kept or max(kept) >= size:
        raise ValueError("matrices of different sizes, or coordinates outside of them")
    forms = {
        (_index(each["mode"]), tuple(map(_index, each["word"]))): _square(each["form"], len(kept))
        for each in document["forms"]
    }
    owners = [set(each.labels) for each in cells]
    if sum(map(len, owners)) != len(set().union(*owners)):
        raise ValueError("a label of two letters")
    return Certificate(
        of=tuple(map(str, document["of"])),
        radius=_number(document["radius"]),
        family=LoopFamily(matrices=matrices, kept=kept, letters=tuple(letters)),
        cells=tuple(cells),
        coordinates=_square(document["coordinates"], len(kept)),
        memory=_index(document["memory"]),
        basis=None if document["basis"] is None else _square(document["basis"], size),
        forms=forms,
    )


def _factor(entries: list[Any], matrices: Mapping[str, Floats], parameters: int) -> Factor:
    name, times = str(entries[0]), tuple(map(_number, entries[1:]))
    if name not in matrices or (times and len(times) != parameters + 1):
        raise ValueError(f"factor {entries}")
    return Factor(matrix=name, times=times or None)


def _square(value: Any, size: int | None = None) -> Floats:
    found: Floats = np.array(value, dtype=float)
    if found.shape != (len(found), len(found)) or not np.isfinite(found).all() or size not in (None, len(found)):
        raise ValueError("expected a square matrix of finite numbers")
    return found


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"expected a finite number, not {value!r}")
    return float(value)


def _index(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise ValueError(f"expected a whole number, not {value!r}")
    return value
