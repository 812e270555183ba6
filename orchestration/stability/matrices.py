"""A component about rest as matrices, in coordinates that mean something: values of its outputs, now and later."""

from dataclasses import dataclass

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats
from orchestration.stability.linearised_component import Tangent

CONTINUOUS = 1e-7
"""by how much two steps of half the length may differ from one, relative"""
APART = (0.1, 1e-3, 1e-5, 1e-8)
"""of a coordinate: how much of it, relative, those before it must leave open; tried in turn"""


@dataclass(frozen=True, kw_only=True)
class Matrices:
    """y = C x + D u; ẋ = A x + B u of a component in continuous time, x⁺ = A x + B u of one that is sampled."""

    A: Floats
    B: Floats
    C: Floats
    D: Floats
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


def in_continuous_time(tangent: Tangent, name: str, step: float, period: float) -> Matrices:
    """Of a component that is stepped at most `step` [s] at a time; raises `UsageError` where its steps are no flow."""
    from scipy.linalg import expm, logm

    cut, n, m = len(tangent.outputs), len(tangent.state), len(tangent.inputs)
    whole, half = (_stepped(tangent, h) for h in (step, 0.5 * step))
    if np.abs(half @ half - whole)[: n + m].max(initial=0.0) > CONTINUOUS * max(1.0, np.abs(whole).max()):
        raise UsageError(
            f"{name}: two half steps differ from a whole one, so it is no linear system in continuous time"
        )
    by_state, by_input = tangent.derivatives(step)
    A = np.real(logm(whole)) / step if n + m else whole
    C = by_state[:cut] @ np.linalg.inv(whole[:n, :n])
    D = by_input[:cut] - C @ whole[:n, n:]
    D[np.abs(D) < CONTINUOUS * np.abs(by_input[:cut]).max(initial=1.0)] = 0.0
    found = Matrices(A=A[:n, :n], B=A[:n, n:], C=C, D=D, inputs=tangent.inputs, outputs=tangent.outputs)
    return _told(found, expm(found.A * period))


def of_samples(tangent: Tangent, period: float) -> Matrices:
    """Of a component that is sampled every `period` [s]."""
    by_state, by_input = tangent.derivatives(period)
    cut = len(tangent.outputs)
    found = Matrices(
        A=by_state[cut:], B=by_input[cut:], C=by_state[:cut], D=by_input[:cut], inputs=tangent.inputs,
        outputs=tangent.outputs,
    )  # fmt: skip
    return _told(found, found.A)


def minds_its_step(tangent: Tangent, period: float) -> bool:
    """Whether a sample does something else where the next one comes at another time."""
    usual, sooner = (np.hstack(tangent.derivatives(h)) for h in (period, 0.9 * period))
    return bool(np.abs(usual - sooner).max(initial=0.0) > CONTINUOUS * np.abs(usual).max(initial=1.0))


def _stepped(tangent: Tangent, h: float) -> Floats:
    """The derivative of a step of `h` [s], the inputs as further states that stay."""
    by_state, by_input = tangent.derivatives(h)
    cut, n, m = len(tangent.outputs), len(tangent.state), len(tangent.inputs)
    found: Floats = np.eye(n + m)
    found[:n, :n], found[:n, n:] = by_state[cut:], by_input[cut:]
    return found


def _told(of: Matrices, after: Floats) -> Matrices:
    """In coordinates that are outputs, now or, by `after`, periods later, the inputs at rest: the first that serve."""
    rows, power = [], np.eye(len(of.A))
    for _ in range(max(len(of.A), 1)):
        rows += list(of.C @ power)
        power = after @ power
    chosen, span = list[Floats](), np.zeros((0, len(of.A)))
    for apart in APART:
        for row in rows:
            size = float(np.linalg.norm(row))
            beyond = row - (row @ span.T) @ span
            beyond -= (beyond @ span.T) @ span
            left = float(np.linalg.norm(beyond))
            if len(chosen) < len(of.A) and left > apart * size > 0.0:
                chosen.append(row)
                span = np.vstack([span, beyond / left])
    if len(chosen) < len(of.A):
        return of
    onto = np.array(chosen).reshape(len(of.A), len(of.A))
    back = np.linalg.inv(onto) if len(onto) else onto
    return Matrices(A=onto @ of.A @ back, B=onto @ of.B, C=of.C @ back, D=of.D, inputs=of.inputs, outputs=of.outputs)
