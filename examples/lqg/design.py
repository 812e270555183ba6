"""The gains of LQG for the loop of system.toml, and its cost: `python examples/lqg/design.py`.

In discrete time, by scipy's Riccati equations: the time between samples is integrated into the matrices. Prints the
gains for some delays, and draws figure.png.
"""

import dataclasses
import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from scipy.linalg import expm, solve_discrete_are

import quadcosim
from orchestration.simulation.figures.palette import BLUE, ORANGE, RED
from orchestration.simulation.figures.style import DOCS, save
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from orchestration.theory.exact.expect import expected_of
from orchestration.theory.exact.loops import Loops

HERE = Path(__file__).resolve().parent
OMEGA, PERIOD = 3.0, 0.1
"""Natural frequency of the pendulum [1/s], and period of the controller [s]"""
PRICE = 0.1
"""weight of u² relative to the square of the angle"""
DISTURBANCE, NOISE = 0.01, 0.01
"""its intensity [rad²/s³]; standard deviation of a measurement [rad]"""
GAINS = ("k_angle", "k_rate", "k_u", "l_angle", "l_rate")
"""Gains of the command, and of the correction by a measurement"""
PARAMETERS = "components.controller.parameters"
RUNS = (0.0, 0.04, 0.08)
"""delays [s] of runs in the figure"""

Matrix = npt.NDArray[np.float64]

A = np.array([[0.0, 1.0, 0.0, 0.0], [OMEGA**2, 0.0, -(OMEGA**2), 0.0], [0.0] * 4, [0.0] * 4])
"""Matrix of angle, rate, the held command, and the pending one"""
ARRIVES = np.eye(4)[[0, 1, 3, 3]]
W = np.diag([0.0, DISTURBANCE, 0.0, 0.0])
Q = np.diag([1.0, 0.0, PRICE, 0.0])
MEASURED = np.array([[1.0, 0.0, 0.0]])


@dataclass(frozen=True, kw_only=True)
class Design:
    """The optimal design for a delay."""

    gains: dict[str, float]
    """Gains by the parameters of the controller"""
    cost: float
    """J"""


def lqg(delay: float = 0.0) -> Design:
    """The optimal gains if every command arrives `delay` [s], up to a period, after its sample."""
    late, soon = _over(delay), _over(PERIOD - delay)
    change = soon[0] @ ARRIVES @ late[0]
    weights = late[1] + late[0].T @ ARRIVES.T @ soon[1] @ ARRIVES @ late[0]
    spread = soon[0][:3, :3] @ late[2][:3, :3] @ soon[0][:3, :3].T + soon[2][:3, :3]
    between = late[3] + soon[3] + float(np.trace(soon[1] @ late[2]))
    x, u = slice(0, 3), slice(3, 4)  # angle, rate and the command before; the command
    F, G = change[x, x], change[x, u]
    S = solve_discrete_are(F, G, weights[x, x], weights[u, u], s=weights[x, u])
    price = weights[u, u] + G.T @ S @ G
    K = np.linalg.solve(price, G.T @ S @ F + weights[u, x])
    plant = F[:2, :2]
    predicted = np.zeros((3, 3))
    predicted[:2, :2] = solve_discrete_are(plant.T, MEASURED[:, :2].T, spread[:2, :2], np.array([[NOISE**2]]))
    L = predicted @ MEASURED.T / (MEASURED @ predicted @ MEASURED.T + NOISE**2)
    corrected = predicted - L @ MEASURED @ predicted
    cost = (np.trace(S @ spread) + np.trace(K.T @ price @ K @ corrected) + between) / PERIOD
    gains = [*(0.0 - K[0]).tolist(), *L[:2, 0].tolist()]
    return Design(gains=dict(zip(GAINS, gains)), cost=float(cost))


def _over(time: float) -> tuple[Matrix, Matrix, Matrix, float]:
    """Over a time: e^(At), the cost of the state as a matrix, the covariance of the noise, and its cost.

    All are linear in the second moments: moments' = A moments + moments A' + W, cost' = the sum of Q * moments.
    """
    n = len(A)
    moments = np.kron(A, np.eye(n)) + np.kron(np.eye(n), A)
    whole = expm(time * np.block([
        [moments, np.zeros((n * n, 1)), W.reshape(-1, 1)],
        [Q.reshape(1, -1), np.zeros((1, 2))],
        [np.zeros((1, n * n + 2))],
    ]))  # fmt: skip
    shape = (n, n)
    return expm(A * time), whole[-2, :-2].reshape(shape), whole[:-2, -1].reshape(shape), float(whole[-2, -1])


def at(delay: float, *, gain_knows: bool, filter_knows: bool) -> System:
    """The loop of system.toml under a delay [s], with gain and filter designed for it or for none."""
    gains = {f"{PARAMETERS}.{name}": gain for name, gain in lqg(delay if gain_knows else 0.0).gains.items()}
    delays = {f"{PARAMETERS}.delay": delay if filter_knows else 0.0, "connections.command.delay": delay}
    return quadcosim.changed(quadcosim.load_system(HERE / "system.toml"), {**gains, **delays})


def over_delays() -> Figure:
    """The exact cost over the delay of the command, by design, compared with runs."""
    figure = DOCS.figure(26.0)
    axes = figure.subplots()
    delays = np.linspace(0.0, PERIOD, 41)
    loops = Loops(files_of(at(0.0, gain_knows=True, filter_knows=True)).models)
    for label, color, dashes, gain_knows, filter_knows in (
        ("neither filter nor gain knows of the delay", RED, "-", False, False),
        ("the filter does", ORANGE, "--", False, True),
        ("both do: LQG", BLUE, "-.", True, True),
    ):
        system = functools.partial(at, gain_knows=gain_knows, filter_knows=filter_knows)
        costs = np.array([expected_of(system(d), loops).objectives["J"] for d in delays.tolist()], float)
        axes.plot(1e3 * delays, 1e4 * costs, dashes, color=color, label=label)
        for late in RUNS:
            runs = [quadcosim.run(dataclasses.replace(system(late), seed=seed)).metrics["J"] for seed in range(4)]
            axes.plot([1e3 * late] * len(runs), 1e4 * np.array(runs, float), ".", color=color, markersize=4)
    axes.set(xlabel="delay of the command [ms]", ylabel="cost J [10⁻⁴ rad²]", ylim=(0.0, 50.0))
    axes.set_title("lines: exact; dots: runs of 300 s")
    axes.legend(loc="upper left")
    return figure


def main() -> None:
    """Print the gains for some delays, and draw the figure."""
    for delay in (0.0, 0.5 * PERIOD, PERIOD):
        design = lqg(delay)
        gains = ", ".join(f"{name} {value:.6g}" for name, value in design.gains.items())
        print(f"{1e3 * delay:g} ms late: J = {1e4 * design.cost:.6f}e-4 rad²; {gains}")
    with DOCS.applied():
        print(*save({"figure": over_delays()}, HERE, DOCS))


if __name__ == "__main__":
    main()
