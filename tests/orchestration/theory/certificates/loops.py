"""Loops as matrices that are written down here: letters of which stability is known."""

from fractions import Fraction

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import System
from orchestration.theory.certificates.certificate import Cells, Certificate
from orchestration.theory.certificates.certified_loop import CertifiedLoop
from orchestration.theory.certificates.family import Factor, Letter, LoopFamily
from orchestration.theory.stability.matrices import (
    Components,
    Continuous,
    Matrices,
    SampledSystem,
    in_output_coordinates,
)

HOVER_A = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 19.62, 0.0], [0.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 0.0]])
HOVER_B = np.array([[0.0], [0.0], [0.0], [1.0]])
HOVER_F = np.array([[-280.9746177, -97.0239144, -430.1129600, -25.49]])
"""A lateral axis of the quadrotor about hover, and its law"""


def late_command(A: Floats, B: Floats, F: Floats, period: float, jitter: float) -> LoopFamily:
    """ẋ = A x + B u under u = F x of each sample, which arrives up to `jitter` later."""
    n, m = B.shape
    size = n + 2 * m
    flow, sample, arrive = np.zeros((size, size)), np.eye(size), np.eye(size)
    flow[:n, :n], flow[:n, n : n + m] = A, B
    sample[n + m :], arrive[n : n + m] = 0.0, 0.0
    sample[n + m :, :n], arrive[n : n + m, n + m :] = F, np.eye(m)
    product = (
        Factor(matrix="sample"), Factor(matrix="flow", times=(0.0, 1.0)), Factor(matrix="arrive"),
        Factor(matrix="flow", times=(period, -1.0)),
    )  # fmt: skip
    return LoopFamily(
        matrices={"flow": flow, "sample": sample, "arrive": arrive},
        kept=tuple(range(size)),
        letters=(Letter(name="late", product=product, ranges=((0.0, jitter),)),),
    ).without_idle()


def switched(*matrices: Floats) -> LoopFamily:
    """Any of some matrices at each step."""
    return LoopFamily(
        matrices={f"m{i}": matrix for i, matrix in enumerate(matrices)},
        kept=tuple(range(len(matrices[0]))),
        letters=tuple(Letter(name=f"m{i}", product=(Factor(matrix=f"m{i}"),)) for i in range(len(matrices))),
    )


def certificate_of(family: LoopFamily, form: Floats) -> Certificate:
    """One form for letters without parameters, in the coordinates of the family."""
    cells = tuple(Cells(edges=(), labels=(i,)) for i in range(len(family.letters)))
    return Certificate(
        of=("here",), radius=0.0, family=family, cells=cells,
        coordinates=np.eye(len(form)), memory=0, forms={(0, ()): form},
    )  # fmt: skip


def through_a_filter() -> CertifiedLoop:
    """An oscillator under a law that reads what a filter passes on at the same instants, once a second.

    It is stable if the law reads what is passed on at its own instant, and if it reads what was at the one before, but
    not in turn.
    """

    def static(inputs: str, outputs: str, D: Floats) -> SampledSystem:
        nothing = np.zeros((0, 0))
        B, C = np.zeros((0, len(inputs))), np.zeros((len(outputs), 0))
        return SampledSystem(inputs=tuple(inputs), outputs=tuple(outputs), A=nothing, B=B, C=C, D=D)

    plant = Continuous(
        inputs=("u",), outputs=("p", "v"), A=np.array([[0.0, 1.0], [-2.4, 0.15]]), B=np.array([[0.0], [1.0]]),
        C=np.eye(2), D=np.zeros((2, 1)),
    )  # fmt: skip
    every = Sampling(period=1.0)
    system = System(
        stop_time=10.0,
        components={
            "plant": Component(fmu="plant.fmu", step=0.1), "filter": Component(fmu="filter.fmu", sampling=every),
            "law": Component(fmu="law.fmu", sampling=every),
        },
        connections=(
            Connection(name="measurement", start=("plant.p", "plant.v"), end=("filter.p", "filter.v")),
            Connection(name="between", start=("filter.x", "filter.y"), end=("law.x", "law.y")),
            Connection(name="command", start=("law.u",), end=("plant.u",)),
        ),
    )  # fmt: skip
    law = static("xy", "u", np.array([[0.8, 0.05]]))
    components: Components = {"plant": plant, "filter": static("pv", "xy", np.eye(2)), "law": law}
    return CertifiedLoop(system=system, components=components, period=Fraction(10**9))


def static(inputs: str, outputs: str, D: list[float]) -> SampledSystem:
    """An output that is the sum of inputs by these factors."""
    nothing, one = np.zeros((0, 0)), np.zeros((1, 0))
    return SampledSystem(
        inputs=tuple(inputs), outputs=tuple(outputs), A=nothing, B=np.zeros((0, len(D))), C=one, D=np.array([D])
    )


def double_integrator() -> Continuous:
    """Position and speed under a force."""
    return Continuous(
        inputs=("u",), outputs=("p", "v"), A=np.array([[0.0, 1.0], [0.0, 0.0]]), B=np.array([[0.0], [1.0]]),
        C=np.eye(2), D=np.zeros((2, 1)),
    )  # fmt: skip


def behind_a_sensor() -> CertifiedLoop:
    """A double integrator whose position a sensor sends four times a second, to a law that samples 0.3 s after each.

    A message is under way for 0.02 s at least, the command for 0.1 s.
    """
    system = System(
        stop_time=10.0,
        components={
            "plant": Component(fmu="plant.fmu", step=0.1),
            "sensor": Component(fmu="sensor.fmu", sampling=Sampling(period=0.25)),
            "law": Component(fmu="law.fmu", sampling=Sampling(period=1.0, offset=0.3)),
        },
        connections=(
            Connection(name="position", start=("plant.p",), end=("sensor.p",)),
            Connection(name="message", start=("sensor.s",), end=("law.s",), delay=0.02),
            Connection(name="command", start=("law.u",), end=("plant.u",), delay=0.1),
        ),
    )
    components: Components = {
        "plant": double_integrator(), "sensor": static("p", "s", [1.0]), "law": static("s", "u", [-0.5])
    }  # fmt: skip
    return CertifiedLoop(system=system, components=components, period=Fraction(10**9))


def cascade(*, late: float = 0.0, wait: float = 0.0) -> CertifiedLoop:
    """A double integrator under an outer law once a second, which is `late` and whose wish arrives after `wait`.

    An inner law samples four times a second; its command arrives 0.1 s later.
    """

    system = System(
        stop_time=10.0,
        components={
            "plant": Component(fmu="plant.fmu", step=0.1),
            "outer": Component(fmu="outer.fmu", sampling=Sampling(period=1.0, offset=late)),
            "inner": Component(fmu="inner.fmu", sampling=Sampling(period=0.25)),
        },
        connections=(
            Connection(name="position", start=("plant.p",), end=("outer.p",)),
            Connection(name="wish", start=("outer.w",), end=("inner.w",), delay=wait),
            Connection(name="speed", start=("plant.v",), end=("inner.v",)),
            Connection(name="command", start=("inner.u",), end=("plant.u",), delay=0.1),
        ),
    )
    components: Components = {
        "plant": double_integrator(), "outer": static("p", "w", [-0.9]), "inner": static("wv", "u", [1.8, -1.8])
    }  # fmt: skip
    return CertifiedLoop(system=system, components=components, period=Fraction(10**9))


def cart_under_lqg() -> CertifiedLoop:
    """A cart with a pendulum upright, at 10 ms under LQG of position and angle: in coordinates as measured, which are
    outputs at samples one after the other and nearly equal.
    """
    T, M, m, length, g = 0.01, 0.5, 0.2, 0.3, 9.81
    A, B, C = np.zeros((4, 4)), np.array([[0.0], [1.0 / M], [0.0], [-1.0 / (M * length)]]), np.eye(4)[[0, 2]]
    A[0, 1] = A[2, 3] = 1.0
    A[1, 2], A[3, 2] = -m * g / M, (M + m) * g / (M * length)
    flow = expm(T * np.block([[A, B], [np.zeros((1, 5))]]))
    F, G = flow[:4, :4], flow[:4, 4:]
    S = solve_discrete_are(F, G, np.diag([10.0, 1.0, 10.0, 1.0]), np.eye(1))
    K = np.linalg.solve(1.0 + G.T @ S @ G, G.T @ S @ F)
    noise = 1e-5 * np.eye(2)
    P = solve_discrete_are(F.T, C.T, 0.1 * G @ G.T + 1e-6 * np.eye(4), noise)
    L = F @ P @ C.T @ np.linalg.inv(C @ P @ C.T + noise)
    of_law = Matrices(inputs=("p", "a"), outputs=("u",), A=F - G @ K - L @ C, B=L, C=-K, D=np.zeros((1, 2)))
    plant = Continuous(inputs=("u",), outputs=("p", "a"), A=A, B=B, C=C, D=np.zeros((2, 1)))
    system = System(
        stop_time=10.0,
        components={
            "plant": Component(fmu="plant.fmu", step=0.001),
            "law": Component(fmu="law.fmu", sampling=Sampling(period=T)),
        },
        connections=(
            Connection(name="measurement", start=("plant.p", "plant.a"), end=("law.p", "law.a")),
            Connection(name="command", start=("law.u",), end=("plant.u",)),
        ),
    )
    components: Components = {
        "plant": in_output_coordinates(plant, expm(T * A)),
        "law": SampledSystem(**vars(in_output_coordinates(of_law, of_law.A))),
    }
    return CertifiedLoop(system=system, components=components, period=Fraction(10**7))
