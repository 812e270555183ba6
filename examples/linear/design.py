"""Gains of LQR, LQI and PID from the plant's FMU, with their margins: `python examples/linear/design.py`.

Writes lqr.toml, lqi.toml and pid.toml beside this file, and figure.png. It needs the extra `control`, and a C compiler.
"""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import control
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

import quadcosim
from orchestration.simulation.figures.palette import BLUE, DASHES, GREEN, GREY, ORANGE
from orchestration.simulation.figures.style import DOCS, save
from orchestration.systems.system.component import Parameter
from quadcosim import FmuChoice, Linearised, Scenario, StateSpace, Timing

HERE = Path(__file__).resolve().parent
PERIOD = 0.01
"""Period of the design [s], the default of scenarios"""
GRAVITY = 9.81
ACCEPTABLE_ERRORS = {"position": 0.5, "velocity": 1.0, "quaternion": 0.1, "angular_velocity": 2.0}
"""Acceptable sizes, by which errors are weighed against commands (Bryson's rule)"""
ACCEPTABLE_COMMANDS = {"thrust": 4.0, "torque": 6.0}
INTEGRAL = 0.5
"""Acceptable size of the integral [m.s]"""
ATTITUDE, POSITION = (12.0, 60.0), (2.5, 45.0)
"""Crossover [rad/s] and phase margin [degrees] of the PID's loops"""
SLOW = POSITION[0] / 5.0
"""Corner of its integral [1/s]"""
PULLED_BY = {"x": ("torque.y", -1.0 / GRAVITY), "y": ("torque.x", 1.0 / GRAVITY), "z": ("thrust", -1.0)}
"""The command that moves the vehicle along an axis, and the attitude or thrust commanded for 1 m/s² (of 1 kg)"""

FREQUENCIES = np.geomspace(0.3, 0.99 * np.pi / PERIOD, 400)
"""Frequencies of figures and margins [rad/s]"""

Matrix = npt.NDArray[np.float64]
Gains = dict[str, list[float]]


def loop_of(gains: Mapping[str, list[float]] | None = None, delay: float = 0.0) -> Linearised:
    """The loop about hover with these gains."""
    parameters: dict[str, Parameter] = {
        f"{name}.{axis}": value for name, each in (gains or {}).items() for axis, value in zip("xyz", each)
    }
    flight = Scenario(
        controller=FmuChoice(fmu=str(HERE / "native" / "LinearFeedback.fmu"), parameters=parameters),
        plant=FmuChoice(fmu="native/QuadrotorPlant"),
        timing=Timing(period=PERIOD, delay=delay),
    )
    return quadcosim.linearise(flight)


def lqr(plant: StateSpace) -> Gains:
    """LQR: the least weighted sum of squares of errors and commands."""
    feedback, _, _ = control.dlqr(plant.A, plant.B, *_weights(plant))
    return _as_gains(plant, feedback @ np.linalg.pinv(plant.C))


def lqi(plant: StateSpace) -> Gains:
    """LQI: LQR with the integral of the position, as in the law: z(k+1) = z(k) + T position(k)."""
    places = [plant.outputs.index(f"position.{axis}") for axis in "xyz"]
    n, m = plant.B.shape
    A = np.block([[plant.A, np.zeros((n, 3))], [PERIOD * plant.C[places], np.eye(3)]])
    B = np.vstack([plant.B, np.zeros((3, m))])
    Q, R = _weights(plant)
    Q = np.block([[Q, np.zeros((n, 3))], [np.zeros((3, n)), np.eye(3) / INTEGRAL**2]])
    feedback, _, _ = control.dlqr(A, B, Q, R)
    return _as_gains(plant, feedback[:, :n] @ np.linalg.pinv(plant.C), feedback[:, n:])


def pid(plant: StateSpace) -> Gains:
    """PID by crossover and phase margin: first of the attitude, then of the position over it, on the sampled loops."""
    at = plant.to_control()

    def response(z: complex, command: str, measured: str) -> complex:
        return complex(at(z)[plant.outputs.index(measured), plant.inputs.index(command)])

    def attitude(z: complex, axis: str) -> tuple[complex, complex]:
        """The factors of k_tilt and k_rate in the loop of a torque."""
        return 2.0 * response(z, f"torque.{axis}", f"quaternion.{axis}"), response(
            z, f"torque.{axis}", f"angular_velocity.{axis}"
        )

    tilt, rate = np.transpose([_crossing(partial(attitude, axis=axis), *ATTITUDE) for axis in "xyz"]).tolist()

    def pulled(z: complex, axis: str) -> tuple[complex, complex]:
        """The factors of k_p, with its integral, and of k_d in the loop of the position."""
        command, factor = PULLED_BY[axis]
        if command != "thrust":
            i = "xyz".index(command[-1])
            factor *= tilt[i] / (1.0 + np.dot(attitude(z, command[-1]), (tilt[i], rate[i])))
        summed = 1.0 + SLOW * PERIOD / (z - 1.0)
        return summed * factor * response(z, command, f"position.{axis}"), factor * response(
            z, command, f"velocity.{axis}"
        )

    p, d = np.transpose([_crossing(partial(pulled, axis=axis), *POSITION) for axis in "xyz"]).tolist()
    return {"k_p": p, "k_d": d, "k_i": [each * SLOW for each in p], "k_tilt": tilt, "k_rate": rate}


def _crossing(parts: Callable[[complex], tuple[complex, complex]], frequency: float, margin: float) -> list[float]:
    """The two gains for which the sum of the parts of a loop has magnitude one at a frequency, and a phase margin."""
    of, loop = parts(complex(np.exp(1j * frequency * PERIOD))), -np.exp(1j * np.radians(margin))
    found: list[float] = np.linalg.solve([np.real(of), np.imag(of)], [loop.real, loop.imag]).tolist()
    return found


# -- from matrices to the gains of the law ---------------------------------------------------------------------------


def _weights(plant: StateSpace) -> tuple[Matrix, Matrix]:
    """The weights of states and commands."""
    errors = np.array([1.0 / ACCEPTABLE_ERRORS[name.partition(".")[0]] for name in plant.outputs])
    commands = np.array([1.0 / ACCEPTABLE_COMMANDS[name.partition(".")[0]] for name in plant.inputs])
    return plant.C.T @ np.diag(errors**2) @ plant.C, np.diag(commands**2)


def _as_gains(plant: StateSpace, by_measured: Matrix, by_integral: Matrix | None = None) -> Gains:
    """The law's gains for a feedback u = -K y; that of the tilt is a factor of those of the position along its axis."""

    def gain(command: str, measured: str) -> float:
        return float(by_measured[plant.inputs.index(command), plant.outputs.index(measured)])

    def summed(command: str, axis: int) -> float:
        return 0.0 if by_integral is None else float(by_integral[plant.inputs.index(command), axis])

    tilt = [gain(f"torque.{axis}", f"quaternion.{axis}") / 2.0 for axis in "xyz"]
    factors = {
        command: factor * (1.0 if command == "thrust" else tilt["xyz".index(command[-1])])
        for command, factor in PULLED_BY.values()
    }
    by_axis = [(axis, command, factors[command]) for axis, (command, _) in PULLED_BY.items()]
    return {
        "k_p": [gain(command, f"position.{axis}") / factor for axis, command, factor in by_axis],
        "k_d": [gain(command, f"velocity.{axis}") / factor for axis, command, factor in by_axis],
        "k_i": [summed(command, "xyz".index(axis)) / factor for axis, command, factor in by_axis],
        "k_tilt": tilt,
        "k_rate": [gain(f"torque.{axis}", f"angular_velocity.{axis}") for axis in "xyz"],
    }


# -- margins ---------------------------------------------------------------------------------------------------------


def broken_at(loop: Linearised, command: str) -> Any:
    """The frequency response of the loop of one command, for a vehicle with decoupled axes."""
    i = loop.rest.inputs.index(command)
    law, rest = loop.component.to_control(), loop.rest.to_control()
    points = np.exp(1j * FREQUENCIES * loop.rest.dt)
    return control.frd([-(law(z) @ rest(z))[i, i] for z in points], FREQUENCIES)


def margins(loop: Linearised, command: str) -> tuple[float, float]:
    """The phase margin [degrees] and its frequency [rad/s]."""
    _, phase, _, _, crossover, _ = control.stability_margins(broken_at(loop, command))
    return float(phase), float(crossover)


def bode(sets: Mapping[str, Gains]) -> Figure:
    """The Bode plot of the loop of the torque about y, which includes the position."""
    figure = DOCS.figure(38.0)
    sizes, phases = figure.subplots(2, 1, sharex=True)
    for (name, gains), color, dashes in zip(sets.items(), (GREY, BLUE, GREEN, ORANGE), DASHES):
        loop = loop_of(gains)
        found, (margin, crossover) = broken_at(loop, "torque.y"), margins(loop, "torque.y")
        label = f"{name.upper()}: {margin:.0f}° at {crossover:.1f} rad/s"
        sizes.loglog(FREQUENCIES, found.magnitude.ravel(), dashes, color=color, label=label)
        phases.semilogx(FREQUENCIES, np.degrees(np.unwrap(found.phase.ravel())) - 360.0, dashes, color=color)
    sizes.axhline(1.0, color=GREY, linewidth=0.8)
    phases.axhline(-180.0, color=GREY, linewidth=0.8)
    sizes.set(ylabel="loop gain |L|", title=f"the torque about y, sampled every {1000 * PERIOD:g} ms: phase margins")
    phases.set(xlabel="frequency [rad/s]", ylabel="phase of L [°]")
    phases.yaxis.set_major_locator(MultipleLocator(90.0))
    sizes.legend(loc="upper right")
    return figure


def main() -> None:
    """Design and write the gains, and print the margins."""
    plant = loop_of().rest
    found = {"lqr": lqr(plant), "lqi": lqi(plant), "pid": pid(plant)}
    for name, gains in found.items():
        (HERE / f"{name}.toml").write_text(_scenario(name, gains), encoding="utf-8")
        (torque, at), (thrust, there) = (margins(loop_of(gains), command) for command in ("torque.y", "thrust"))
        late = min(np.radians(torque) / at, np.radians(thrust) / there)
        print(
            f"{name.upper()}: {torque:.0f}° at {at:.1f} rad/s, {thrust:.0f}° at {there:.1f} rad/s; "
            f"{1000 * late:.1f} ms may a command be late"
        )
    with DOCS.applied():
        print(*save({"figure": bode({"pd": {}, **found})}, HERE, DOCS))


def _scenario(name: str, gains: Gains) -> str:
    lines = [f"{key}.{axis} = {value + 0.0:.6g}" for key, each in gains.items() for axis, value in zip("xyz", each)]
    return "\n".join(
        [
            f"# {name.upper()} for LinearFeedback.fmu, by: python examples/linear/design.py",
            "",
            "[controller]",
            *lines,
            "",
        ]
    )


if __name__ == "__main__":
    main()
