"""Display names of metrics, signals and settings, with their units, for figures and printed tables."""

import re
from collections.abc import Iterable, Mapping

from orchestration.simulation.results.units import ColumnInfo
from orchestration.systems.system.connection import component_of, variable_of

METRICS: Mapping[str, tuple[str, str | None]] = {
    "outcome": ("outcome", None),
    "good": ("meets the criterion", None),
    "horizon": ("time by which it is judged", "s"),
    "position_rmse": ("RMS position error", "m"),
    "position_iae": ("integral of the position error", "m.s"),
    "position_itae": ("integral of time × position error", "m.s2"),
    "position_max": ("largest position error", "m"),
    "settling_time": ("settling time", "s"),
    "ultimate_bound": ("largest position error, last third", "m"),
    "attitude_error_rmse": ("RMS attitude error", "rad"),
    "attitude_error_max": ("largest attitude error", "rad"),
    "energy_growth_share": ("share of samples at which the energy grows", "1"),
    "control_effort.thrust": ("control effort, thrust", "N2.s"),
    "control_effort.torque": ("control effort, torque", "N2.m2.s"),
    "torque_max": ("largest torque", "N.m"),
    "total_variation.thrust": ("total variation of thrust", "N"),
    "total_variation.torque": ("total variation of torque", "N.m"),
    "saturation_share": ("share of time at a limit of the plant", "1"),
    "diverged": ("diverged", None),
    "divergence_time": ("time of divergence", "s"),
    "steps": ("steps of the plant", None),
    "wall_time": ("time that the run took", "s"),
    "engine": ("engine", None),
}
"""Metrics of a run of the quadrotor: name and unit; docs/metrics.md defines each."""

SETTINGS: Mapping[str, tuple[str, str | None]] = {
    "stop_time": ("stop time", "s"),
    "seed": ("seed", None),
    "vehicle": ("vehicle", None),
    "controller": ("controller", None),
    "controller.fmu": ("controller", None),
    "plant.fmu": ("plant", None),
    "reference.file": ("reference", None),
    "timing.period": ("period", "s"),
    "timing.offset": ("offset of the first sample", "s"),
    "timing.plant_interval": ("plant interval", "s"),
    "timing.order": ("order of exchange", None),
    "timing.hold": ("hold", None),
    "timing.clock": ("clock", None),
    "timing.delay": ("delay", "s"),
    "timing.delay_jitter": ("jitter of the delay", "s"),
    "timing.jitter": ("jitter of the sampling", "s"),
    "timing.jitter_distribution": ("distribution of the jitter", None),
    "timing.noise.position": ("position noise", "m"),
    "timing.noise.velocity": ("velocity noise", "m/s"),
    "timing.noise.angular_velocity": ("angular velocity noise", "rad/s"),
    "timing.measurement_loss": ("loss of measurements", None),
    "timing.command_loss": ("loss of commands", None),
    "timing.clock_ratio": ("clock ratio", None),
    "controller.coupling": ("κ", "kg"),
    "controller.surface_exponent": ("exponent of the surface β_t", None),
    "controller.gain.surface": ("surface gain k_s", None),
    "controller.gain.eta": ("gain k_η", "rad/s"),
    "controller.gain.theta": ("gain k_θ", "N.m.s"),
    "controller.gain.attitude": ("gain k_q", "N.m"),
    "controller.gain.disturbance": ("gain β", "m/s2"),
    "controller.discretisation": ("redesign", None),
    "plant.mass": ("mass", "kg"),
    "plant.thrust_max": ("largest thrust", "N"),
    "plant.torque_max": ("largest torque", "N.m"),
}
"""Settings of a scenario, by path: name and unit; others are named by the words of their path."""

SIGNALS: Mapping[str, str] = {
    "plant.thrust": "thrust",
    "plant.position": "position",
    "plant.velocity": "velocity",
    "plant.quaternion": "attitude quaternion",
    "plant.angular_velocity": "angular velocity",
    "plant.torque": "torque",
    "plant.tilt": "tilt",
    "reference.position": "desired position",
    "controller.position_error": "position error",
    "controller.velocity_error": "velocity error",
    "controller.attitude_error": "attitude error",
    "controller.angular_velocity_error": "angular velocity error",
    "controller.sliding": "sliding variable",
    "controller.energy": "energy L",
}
"""Signals of the quadrotor's loop; vectors by their stem, to which the axis is appended."""

AXES: Mapping[str, str] = {"x": "x", "y": "y", "z": "z", "w": "w"}


def metric(name: str) -> str:
    """The display name of a metric or objective."""
    return METRICS[name][0] if name in METRICS else words(name)


def metric_with_unit(name: str, of: str | None) -> str:
    """The display name of a metric with its unit: the unit from its FMUs, else the quadrotor's."""
    return with_unit(metric(name), of or METRICS.get(name, ("", None))[1])


def setting(path: str) -> str:
    """The display name of a path of a scenario, system or study file: `period of pilot` for
    `components.pilot.sampling.period`.
    """
    known = _known(path)
    if known is not None:
        return known[0]
    head, _, rest = path.partition(".")
    name, _, what = rest.partition(".")
    if head in ("components", "connections", "sources") and what:
        return f"{words(what.removeprefix('sampling.').removeprefix('parameters.'))} of {words(name)}"
    return words(rest) if head in ("timing", "controller", "plant") and rest else words(path)


def unit_of_setting(path: str) -> str | None:
    """The unit of a path of a scenario; None if it is not known here."""
    known = _known(path)
    return None if known is None else known[1]


def _known(path: str) -> tuple[str, str | None] | None:
    """Name and unit of a path, or of a key of the timing without its table, as `limit` uses it."""
    return SETTINGS.get(path) or SETTINGS.get(f"timing.{path}")


def signal(name: str, described: Mapping[str, ColumnInfo]) -> str:
    """The display name of a recorded column: from the table for the quadrotor, else from the FMU's description."""
    stem, _, axis = name.rpartition(".")
    if name in SIGNALS:
        return SIGNALS[name]
    if stem in SIGNALS and axis in AXES:
        return f"{SIGNALS[stem]} {axis}"
    known, what = described.get(name), words(variable_of(name))
    text = (known.text or "").strip().rstrip(".") if known is not None else ""
    if text and len(text) <= MAX_LEGEND_LENGTH:
        what = text if re.search(rf"\b{re.escape(what)}\b", text) else f"{what}, {text}"
    return f"{words(component_of(name))}: {what}"


def quantities(owner: str, columns: Iterable[str]) -> str:
    """The title of a panel: the connection or component that its columns are of, and what they are."""
    stems = [variable_of(column).rpartition(".") for column in columns]
    found = dict.fromkeys(words(stem if stem and axis in AXES else f"{stem}.{axis}") for stem, _, axis in stems)
    text = ", ".join(found)
    return f"{owner}: {text if len(text) <= MAX_LEGEND_LENGTH else f'{next(iter(found))}, …'}"


MAX_LEGEND_LENGTH = 32
"""characters of a description that fit into a legend"""


def words(name: str) -> str:
    """The words of a name in a file."""
    return re.sub(r"[_.\s]+", " ", name).strip()


def unit(text: str | None) -> str | None:
    """A unit in print: N·m for N.m, m/s² for m/s2; None for none and for 1."""
    if text in (None, "", "1"):
        return None
    raised = re.sub(r"(?<=[A-Za-zµΩ°%)])\^?(-?\d+)", lambda match: match[1].translate(_RAISED), str(text))
    return raised.replace(".", "·").replace("*", "·")


_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def amount(value: float, of: str | None) -> str:
    """A number with its unit, to three digits."""
    shown = unit(of)
    return f"{value:.3g}" if shown is None else f"{value:.3g} {shown}"


def with_unit(name: str, of: str | None) -> str:
    """A quantity with its unit in brackets, as on axes and in heads of tables."""
    shown = unit(of)
    return name if shown is None else f"{name} [{shown}]"
