"""Growth rates and states of random loops, half of them unstable in the open, against matrices worked out apart.

Each loop is a plant of FMUs below, sampled by a law of its own, whose numbers are parameters. Plants are nonlinear:
their linear maps are products of matrices here.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from orchestration.components.building import builder
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import System
from orchestration.theory.stability.linearise import linearise
from orchestration.theory.stability.period_map import growth_of_loop
from tests.extent import tries
from tests.orchestration.components.fmi.small import needs_compiler

STEP = 0.002
"""Step of plants [s]"""
SIZES = (1, 2, 3, 4, 6)
LAW_STATES = 2

PLANT = '''
class Plant{n}(Slave):
    """A nonlinear plant of {n} states, two of whose combinations are measured."""

    u = Input("Command", "1")
    y_0 = Output("First measurement", "1")
    y_1 = Output("Second measurement", "1")
{states}
    sine = Parameter("Share of sine in the states", "1", 0.0)
    product = Parameter("Share of a product of states", "1", 0.0)
    hyperbolic = Parameter("Share of the hyperbolic tangent in the command", "1", 0.0)
{parameters}

    def rates(self, {x}):
        """Rates of the states."""
        u = self.u + self.hyperbolic * (math.tanh(self.u) - self.u)
        product = self.product * x_0 * x_{last}
{bent}
        return ({rates})

    def step(self, t, h):
        """Runge and Kutta's fourth-order step."""
        {xs} = {selves}
        {k1} = self.rates({x})
        {k2} = self.rates({half1})
        {k3} = self.rates({half2})
        {k4} = self.rates({whole})
{updates}
        self.y_0, self.y_1 = {y_0}, {y_1}
'''

LAW = '''
class Law(Slave):
    """An observer of two states, or none: a linear law of two measurements."""

    y_0 = Input("First measurement", "1")
    y_1 = Input("Second measurement", "1")
    u = Output("Command", "1")
    z_0 = State("First state", "1", 0.0)
    z_1 = State("Second state", "1", 0.0)
{parameters}

    def step(self, t, h):
        """The command, then the states of the next sample."""
        z_0, z_1, y_0, y_1 = self.z_0, self.z_1, self.y_0, self.y_1
        self.u = self.k_0 * y_0 + self.k_1 * y_1 + self.c_0 * z_0 + self.c_1 * z_1
        self.z_0 = self.f_00 * z_0 + self.f_01 * z_1 + self.g_00 * y_0 + self.g_01 * y_1
        self.z_1 = self.f_10 * z_0 + self.f_11 * z_1 + self.g_10 * y_0 + self.g_11 * y_1
'''


def parameters(names: list[str]) -> str:
    return "\n".join(f'    {name} = Parameter("Entry of a matrix", "1", 0.0)' for name in names)


def entries_of(n: int) -> list[str]:
    """Names of the entries of A, B and C of a plant, by rows."""
    rows = range(n)
    by_states = [f"a_{i}{j}" for i in rows for j in rows] + [f"b_{i}" for i in rows]
    return by_states + [f"c_{i}{j}" for i in (0, 1) for j in rows]


def plant(n: int) -> str:
    rows, x = range(n), ", ".join(f"x_{i}" for i in range(n))
    comma = "," if n == 1 else ""

    def named(name: str) -> str:
        return ", ".join(f"{name}_{i}" for i in rows) + comma

    def later(k: str, share: str) -> str:
        return ", ".join(f"x_{i} + {share} * {k}_{i}" for i in rows)

    return PLANT.format(
        n=n, last=n - 1, x=x, xs=x + comma, selves=", ".join(f"self.x_{i}" for i in rows) + comma,
        states="\n".join(f'    x_{i} = State("State {i}", "1", 0.0)' for i in rows),
        parameters=parameters(entries_of(n)),
        bent="\n".join(f"        s_{i} = x_{i} + self.sine * (math.sin(x_{i}) - x_{i}) + product" for i in rows),
        rates="".join(
            " + ".join([*(f"self.a_{i}{j} * s_{j}" for j in rows), f"self.b_{i} * u"]) + ", " for i in rows
        ),
        k1=named("k"), k2=named("l"), k3=named("m"), k4=named("n"),
        half1=later("k", "h / 2.0"), half2=later("l", "h / 2.0"), whole=later("m", "h"),
        updates="\n".join(
            f"        self.x_{i} = x_{i} + h / 6.0 * (k_{i} + 2.0 * l_{i} + 2.0 * m_{i} + n_{i})" for i in rows
        ),
        y_0=" + ".join(f"self.c_0{j} * self.x_{j}" for j in rows),
        y_1=" + ".join(f"self.c_1{j} * self.x_{j}" for j in rows),
    )  # fmt: skip


LAW_ENTRIES = ["k_0", "k_1", "c_0", "c_1", *(f"{m}_{i}{j}" for m in "fg" for i in (0, 1) for j in (0, 1))]
SOURCE = "\n\n".join(
    [
        '"""Random plants and laws."""\n\nimport math\n',
        "from fmu_kit.interface import Input, Output, Parameter, State\nfrom fmu_kit.slave import Slave\n",
        *map(plant, SIZES),
        LAW.format(parameters=parameters(LAW_ENTRIES)),
    ]
)


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    where = tmp_path_factory.mktemp("random_loops")
    (where / "random_plants.py").write_text(SOURCE)
    slaves = builder.slaves_of(where)
    for folder, packing in (("native", builder.NATIVE), ("python", builder.IN_PYTHON)):
        builder.build_slaves(slaves, where / folder, packing=packing)
    return {folder: where / folder for folder in ("native", "python")}


@dataclass(frozen=True, kw_only=True)
class Loop:
    """A random loop: its matrices, and how it is sampled."""

    A: Floats
    B: Floats
    C: Floats
    law: dict[str, float]
    bent: dict[str, float]
    steps: int
    """Plant's steps in a period"""
    late: int
    """Plant's steps by which a command is late"""

    @classmethod
    def draw(cls, seed: int) -> "Loop":
        rng = np.random.default_rng(seed)
        n = int(rng.choice(SIZES))
        unstable = 1 if seed % 2 else 0
        rates = np.concatenate(
            [10.0 ** rng.uniform(-0.3, 0.8, unstable), -(10.0 ** rng.uniform(-0.5, 1.5, n - unstable))]
        )
        basis = np.linalg.qr(rng.normal(size=(n, n)))[0]
        A, B, C = basis @ np.diag(rates) @ basis.T, rng.normal(size=(n, 1)), rng.normal(size=(2, n))
        steps = int(rng.integers(3, 12))
        map_, moved = step_map(A, B)
        whole = np.linalg.matrix_power(map_, steps)
        pushed = np.sum([np.linalg.matrix_power(map_, k) @ moved for k in range(steps)], axis=0)
        P = solve_discrete_are(whole, pushed, np.eye(n), np.eye(1))
        K = np.linalg.solve(np.eye(1) + pushed.T @ P @ pushed, pushed.T @ P @ whole)
        k = -K @ np.linalg.pinv(C)
        law = dict(zip(LAW_ENTRIES, [*k[0], *np.zeros(10)]))
        if rng.random() < 0.5:  # a law with states
            F, G = np.diag(rng.uniform(-0.8, 0.9, 2)), rng.normal(size=(2, 2))
            law.update(zip(LAW_ENTRIES[2:], [*(0.2 * rng.normal(size=2)), *F.ravel(), *G.ravel()]))
        kinds: tuple[dict[str, float], ...] = ({"sine": 1.0}, {"hyperbolic": 1.0}, {"product": 0.5}, {})
        return cls(
            A=A, B=B, C=C, law=law, bent=kinds[int(rng.integers(4))], steps=steps, late=int(rng.integers(0, steps))
        )

    @property
    def growth(self) -> float:
        """The growth rate [1/s], from products of the linear maps of steps."""
        n, law = len(self.A), self.law
        map_, moved = step_map(self.A, self.B)
        F, G = (np.array([[law[f"{m}_{i}{j}"] for j in (0, 1)] for i in (0, 1)]) for m in "fg")
        k, c = np.array([[law["k_0"], law["k_1"]]]), np.array([[law["c_0"], law["c_1"]]])
        whole = np.eye(n + LAW_STATES + 2)  # states, those of the law, the command that acts, the one on its way
        x, z, acting, coming = slice(0, n), slice(n, n + 2), slice(n + 2, n + 3), slice(n + 3, n + 4)
        sample, arrival, step = (np.eye(len(whole)) for _ in range(3))
        sample[coming] = 0.0
        sample[coming, x], sample[coming, z] = k @ self.C, c
        sample[z, x], sample[z, z] = G @ self.C, F
        arrival[acting] = 0.0
        arrival[acting, coming] = 1.0
        step[x, x], step[x, acting] = map_, moved
        whole = sample
        for j in range(self.steps):
            whole = step @ (arrival @ whole if j == self.late else whole)
        return math.log(np.abs(np.linalg.eigvals(whole)).max()) / (self.steps * STEP)

    def system(self, folder: Path) -> System:
        n, period = len(self.A), self.steps * STEP
        entries = {f"a_{i}{j}": self.A[i, j] for i in range(n) for j in range(n)}
        entries |= {f"b_{i}": self.B[i, 0] for i in range(n)} | {
            f"c_{i}{j}": self.C[i, j] for i in (0, 1) for j in range(n)
        }
        return System(
            stop_time=1.0,
            components={
                "plant": Component(
                    fmu=str(folder / f"Plant{n}.fmu"), step=STEP,
                    parameters={name: float(value) for name, value in (entries | self.bent).items()},
                ),
                "law": Component(
                    fmu=str(folder / "Law.fmu"), sampling=Sampling(period=period),
                    parameters={name: float(value) for name, value in self.law.items()},
                ),
            },
            connections=(
                Connection(name="measured", start=("plant.y_0", "plant.y_1"), end=("law.y_0", "law.y_1")),
                Connection(name="command", start=("law.u",), end=("plant.u",), delay=self.late * STEP),
            ),
        )  # fmt: skip


def step_map(A: Floats, B: Floats) -> tuple[Floats, Floats]:
    """The linear map of a step of the plant: Runge and Kutta's, states by states and by the command."""
    n = len(A)
    M: Floats = np.zeros((n + 1, n + 1))
    M[:n, :n], M[:n, n:] = A * STEP, B * STEP
    found = np.eye(n + 1) + M + M @ M / 2.0 + M @ M @ M / 6.0 + M @ M @ M @ M / 24.0
    return found[:n, :n], found[:n, n:]


@needs_compiler
@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        *(("native", seed) for seed in range(tries(20, sampled=2))),
        *(("python", seed) for seed in range(20, tries(24, sampled=21))),
    ],
)
def test_growth_and_states_are_those_of_the_matrices(
    folders: dict[str, Path], instances: Instances, kind: str, seed: int
) -> None:
    loop = Loop.draw(seed)
    system = loop.system(folders[kind])
    assert growth_of_loop(system, instances) == pytest.approx(loop.growth, abs=1e-4)
    assert len(linearise(system).rest.A) == len(loop.A) + (1 if loop.late else 0)
