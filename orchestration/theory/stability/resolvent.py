"""The answer of a linear map at many frequencies: it is brought to a form once in which each costs n², not n³."""

from dataclasses import dataclass

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.stability.poles import Complexes, balanced

AT_ONCE = 128
"""Frequencies at once, which the cache of a processor holds"""


@dataclass(frozen=True, kw_only=True)
class Resolvent:
    """C (z - A)^-1 B by z, with A in the form of Hessenberg."""

    A: Floats
    B: Floats
    C: Floats

    @classmethod
    def of(cls, A: Floats, B: Floats, C: Floats) -> "Resolvent":
        """That of any matrices: states are balanced, and turned by Householder's reflections."""
        H, units = balanced(A)
        H, B, C = H.copy(), units[:, None] * B, C / units
        for k in range(1, len(H) - 1):
            normal = H[k:, k - 1].copy()
            normal[0] += np.copysign(np.linalg.norm(normal), normal[0])
            if not normal.any():
                continue
            normal *= np.sqrt(2.0) / np.linalg.norm(normal)
            H[k:] -= np.outer(normal, normal @ H[k:])
            B[k:] -= np.outer(normal, normal @ B[k:])
            H[:, k:] -= np.outer(H[:, k:] @ normal, normal)
            C[:, k:] -= np.outer(C[:, k:] @ normal, normal)
        return cls(A=np.triu(H, -1), B=B, C=C)

    def at(self, z: Complexes) -> Complexes:
        """At each z, shape (n, rows of C, columns of B)."""
        parts = [self._at(z[start : start + AT_ONCE]) for start in range(0, len(z), AT_ONCE)]
        return np.concatenate(parts) if parts else np.zeros((0, len(self.C), self.B.shape[1]), dtype=complex)

    def _at(self, z: Complexes) -> Complexes:
        """By rotations of columns, from the last (Henry 1994)."""
        count = len(self.A)
        states = np.repeat(self.B.astype(complex)[:, :, None], len(z), axis=2)  # (states, columns, n)
        column = self._column(count - 1, z) if count else np.zeros((0, len(z)), dtype=complex)
        turns = []
        for k in range(count - 1, 0, -1):
            before = self._column(k - 1, z)[: k + 1]
            size = np.hypot(np.abs(column[k]), np.abs(before[k]))
            c, s = column[k] / size, before[k] / size
            states[k] /= size
            states[:k] -= (c.conj() * column[:k] + s.conj() * before[:k])[:, None] * states[k]
            column = c * before[:k] - s * column[:k]
            turns.append((k, c, s))
        if count:
            states[0] /= column[0]
        for k, c, s in reversed(turns):
            states[k - 1], states[k] = (
                s.conj() * states[k] + c * states[k - 1],
                c.conj() * states[k] - s * states[k - 1],
            )
        return np.asarray(np.tensordot(self.C, states, axes=1).transpose(2, 0, 1))

    def _column(self, k: int, z: Complexes) -> Complexes:
        """A column of z - A at each z, shape (states, n)."""
        found = np.repeat(-self.A[:, k, None].astype(complex), len(z), axis=1)
        found[k] += z
        return found
