"""A stretch of time as a linear map of the state, with noise and costs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.exact.flows import Flow


@dataclass(frozen=True)
class Piece:
    """From a state z of n numbers to one of m: Z z + w, at the costs z'M z + c."""

    Z: Floats
    """shape (m, n)"""
    W: Floats
    """covariance of w, shape (m, m)"""
    M: Floats
    """shape (costs, n, n)"""
    c: Floats
    """shape (costs,)"""

    @staticmethod
    def start(size: int, costs: int) -> Piece:
        """The identity."""
        return Piece(np.eye(size), np.zeros((size, size)), np.zeros((costs, size, size)), np.zeros(costs))

    def flowed(self, flow: Flow) -> Piece:
        """After a flow of the first numbers of the state; the others, messages in transit, stay."""
        n = len(flow.change)
        head = self.Z[:n]
        Z, W = self.Z.copy(), self.W.copy()
        Z[:n] = flow.matrix @ head
        W[:n] = flow.matrix @ W[:n]
        W[:, :n] = W[:, :n] @ flow.matrix.T
        W[:n, :n] += flow.covariance
        c = self.c + np.einsum("kij,ij->k", flow.costs, self.W[:n, :n]) + flow.extra
        return Piece(Z, W, self.M + head.T @ flow.costs @ head, c)

    def mapped(self, change: Floats, covariance: Floats | None = None) -> Piece:
        """After a linear map of the state, which may change its size, and noise of a covariance."""
        W = change @ self.W @ change.T
        return replace(self, Z=change @ self.Z, W=W if covariance is None else W + covariance)

    def charged(self, Q: Floats) -> Piece:
        """With the costs z'Q z of the present state added, Q of its first numbers."""
        n = Q.shape[-1]
        head = self.Z[:n]
        return Piece(
            self.Z, self.W, self.M + head.T @ Q @ head, self.c + np.einsum("kij,ij->k", Q, self.W[:n, :n])
        )  # fmt: skip
