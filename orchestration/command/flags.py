"""The flags of every command that runs a scenario or a system."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from orchestration.command import completion
from orchestration.command.options import option
from orchestration.command.registry import Command, build_option, option_group
from orchestration.foundation.basics.attribute_docs import FieldDoc, attribute_docs
from orchestration.foundation.basics.documents import toml_of
from orchestration.foundation.basics.errors import UsageError, without_unit
from orchestration.systems.system.choices import Clock, Hold, Order, Spread

if TYPE_CHECKING:
    from orchestration.quadrotor.scenarios.scenario import Scenario
    from orchestration.systems.system.model import System
    from orchestration.systems.system.request import Request

TIMING, EFFECTS, MODEL = (
    f"Quadrotor only: {of}; of a system --set" for of in ("timing", "disturbances of the loop", "model")
)
_of_model = partial(option, panel=MODEL)


def _of_timing(key: str, *, panel: str = EFFECTS, **options: Any) -> Any:
    """The flag of a key of `[timing]`, with the text of the record."""
    return _of_record("timing", "Timing", key, panel=panel, **options)


def _of_record(
    module: str,
    name: str,
    key: str,
    *,
    panel: str | None = None,
    metavar: str = "SECONDS",
    words: Any = None,
    tells_default: bool = False,
    repeated: bool = False,
) -> Any:
    doc = attribute_docs(f"orchestration.quadrotor.scenarios.{module}", name).get(key, FieldDoc("", ""))
    text = doc.text.replace(" [s]", "")  # the metavar is SECONDS
    text = f"{text[:-1]}; default: {doc.default}." if tells_default else text
    text = f"{text[:-1]}; may be repeated." if repeated else text
    metavar = metavar if words is None else "|".join(get_args(words))
    return option(f"--{key.replace('_', '-')}", text, metavar, panel=panel)


@dataclass(frozen=True, kw_only=True)
class FlightFlags:
    """The flags on the command line; None: not set, the scenario's value applies."""

    period: Annotated[float | None, _of_timing("period", panel=TIMING, tells_default=True)] = None
    offset: Annotated[float | None, _of_timing("offset", panel=TIMING)] = None
    plant_interval: Annotated[float | None, _of_timing("plant_interval", panel=TIMING, tells_default=True)] = None
    preset: Annotated[
        str | None,
        option(
            "--preset",
            "Sampling period and delay of a real flight stack; other flags override it.",
            "px4|crazyflie|betaflight",
            panel=TIMING,
            autocompletion=completion.presets,
        ),
    ] = None
    order: Annotated[str | None, _of_timing("order", panel=TIMING, words=Order)] = None
    hold: Annotated[str | None, _of_timing("hold", panel=TIMING, words=Hold)] = None
    clock: Annotated[str | None, _of_timing("clock", panel=TIMING, words=Clock)] = None
    delay: Annotated[str | None, _of_timing("delay", metavar="SECONDS|TABLE")] = None
    delay_jitter: Annotated[str | None, _of_timing("delay_jitter", metavar="SECONDS|TABLE")] = None
    jitter: Annotated[str | None, _of_timing("jitter", metavar="SECONDS|TABLE")] = None
    jitter_distribution: Annotated[str | None, _of_timing("jitter_distribution", words=Spread)] = None
    measurement_loss: Annotated[str | None, _of_timing("measurement_loss", metavar="P|TABLE")] = None
    command_loss: Annotated[str | None, _of_timing("command_loss", metavar="P|TABLE")] = None
    loss: Annotated[str | None, option("--loss", "Both losses at once.", "P|TABLE", panel=EFFECTS)] = None
    burst_length: Annotated[float | None, _of_timing("burst_length", metavar="N")] = None
    clock_ratio: Annotated[float | None, _of_timing("clock_ratio", metavar="R")] = None
    noise: Annotated[list[str] | None, _of_timing("noise", metavar="NAME=SIGMA", repeated=True)] = None
    quantisation: Annotated[list[str] | None, _of_timing("quantisation", metavar="NAME=Q", repeated=True)] = None
    seed: Annotated[int | None, _of_record("scenario", "Scenario", "seed", metavar="N")] = None
    stop_time: Annotated[float | None, _of_record("scenario", "Scenario", "stop_time", tells_default=True)] = None
    model_mismatch: Annotated[
        bool | None, _of_record("scenario", "Scenario", "model_mismatch", panel=MODEL, metavar="")
    ] = None
    controller: Annotated[
        str | None,
        _of_model(
            "--controller",
            "The controller: any FMU with its variables; default: UnifiedController.",
            "NAME|PATH",
            autocompletion=completion.controllers,
        ),
    ] = None
    plant: Annotated[
        str | None,
        _of_model(
            "--plant",
            "The plant: any FMU with its variables; default: QuadrotorPlant.",
            "NAME|PATH",
            autocompletion=completion.plants,
        ),
    ] = None
    vehicle: Annotated[
        str | None,
        _of_model(
            "--vehicle",
            "Parameters of plant and controller by a file: paper, crazyflie, hummingbird, agilicious, or a path.",
            "NAME|FILE",
            autocompletion=completion.vehicles,
        ),
    ] = None
    reference: Annotated[
        str | None,
        _of_model(
            "--reference",
            "The reference: hover, step, circle, lemniscate, helix, paper, or way-points; parameters by --set.",
            "NAME|FILE.csv",
        ),
    ] = None
    disturbance: Annotated[
        str | None,
        _of_model(
            "--disturbance",
            "Disturbance of the vehicle: dryden (gusts), or force or wind over time; parameters by --set.",
            "NAME|FILE.csv",
        ),
    ] = None
    native: Annotated[
        bool | None,
        option("--native", "Use native twins (no Python inside) of FMUs with sources here; built if need be.", ""),
    ] = None
    set: Annotated[
        list[str] | None,
        option(
            "--set",
            "A value by its path: of the quadrotor controller.NAME=V, of a system as connections.NAME.delay=V; may be "
            "repeated.",
            "PATH=V",
        ),
    ] = None

    def applied_to(self, scenario: "Scenario") -> "Scenario":
        """`scenario` with these flags; raises `UsageError` for invalid values."""
        from orchestration.components.building.fmus import native_twins
        from orchestration.quadrotor.scenarios.timing import LOSSES, TIMING_KEYS, loss_as_written, preset_timing
        from orchestration.quadrotor.scenarios.translation import DisturbanceChoice, ReferenceChoice, choice_of
        from orchestration.quadrotor.scenarios.vehicle import load_vehicle

        timing: dict[str, Any] = {} if self.preset is None else preset_timing(self.preset)
        single = (f.name for f in fields(self) if f.name in TIMING_KEYS and f.name not in _BY_MEASUREMENT)
        timing |= {key: value for key in single if (value := self._timed(key)) is not None}
        written = {*timing}
        if (loss := self._timed("loss")) is not None:
            written.add("loss")
            timing = {**dict.fromkeys(LOSSES, loss), **timing}
        for name in _BY_MEASUREMENT:
            texts = getattr(self, name)
            if texts:
                old: Mapping[str, float] = getattr(scenario.timing, name)
                timing[name] = {**old, **{key: _number(f"--{name} {key} =", text) for key, text in _pairs(name, texts)}}
        top: dict[str, Any] = {
            name: value
            for name in ("seed", "stop_time", "model_mismatch")
            if (value := getattr(self, name)) is not None
        }
        if self.vehicle is not None:
            top["vehicle"] = load_vehicle(self.vehicle, Path())
        if self.reference is not None:
            top["reference"] = ReferenceChoice(**choice_of(self.reference))
        if self.disturbance is not None:
            top["disturbance"] = DisturbanceChoice(**choice_of(self.disturbance))
        parameters = assigned("set", self.set)
        with loss_as_written(written):
            changed = scenario.with_changes(timing=timing, parameters=parameters, **top)
        if self.controller or self.plant:
            plant, controller = self.plant or changed.plant.fmu, self.controller or changed.controller.fmu
            changed = changed.with_fmus(plant=plant, controller=controller)
        return native_twins(changed) if self.native else changed

    def _timed(self, key: str) -> Any:
        """The value of a flag; of one that may be random a number, or the text of the table of its distribution."""
        from orchestration.quadrotor.scenarios.timing import Timing
        from orchestration.systems.system.distribution import AS_TABLE, is_table, may_vary

        text = getattr(self, key)
        if text is None or is_table(text) or not (key == "loss" or key in may_vary(Timing)):
            return text
        expected = f"a number, or a table of its distribution, {AS_TABLE}"
        return _number(f"--{key.replace('_', '-')}", text, expected)

    def applied_to_system(self, system: "System") -> "System":
        """`system` with these flags; raises `UsageError` for flags that apply to the quadrotor only."""
        from orchestration.components.building.fmus import native_twins
        from orchestration.systems.system.paths import changed

        of_systems = ("seed", "stop_time", "set", "native")
        top: dict[str, Any] = {
            name: value for name in ("seed", "stop_time") if (value := getattr(self, name)) is not None
        }
        of_quadrotor = [f.name for f in fields(self) if f.name not in of_systems and getattr(self, f.name)]
        if of_quadrotor:
            flags = ", ".join(f"--{name.replace('_', '-')}" for name in of_quadrotor)
            raise UsageError(
                f"{flags}: for the quadrotor only; expected --set PATH=V for a system, as connections.NAME.delay or "
                "components.NAME.sampling.period"
            )
        system = native_twins(system) if self.native else system
        return changed(system, {**top, **assigned("set", self.set)})


EngineFlag = Annotated[
    str | None,
    option("--engine", "Simulation loop, with the same results; default: compiled where possible.", "python|compiled"),
]

AsSimulated = Annotated[
    bool, option("--as-simulated", "The average of what runs print: noise held, means over their rows.")
]

ScenarioFile = Annotated[
    Path | None, typer.Argument(help="System or scenario file, or SSP; without one, the paper's flight.")
]

Timing = Annotated[Path | None, typer.Argument(help="Of an SSP: the file with its timing, which SSP cannot express.")]

_BY_MEASUREMENT = ("noise", "quantisation")


def flight_options(command: Command) -> Command:
    """Give a command the flags of this module and `--build`."""
    return build_option(option_group("flags", FlightFlags)(command))


def request_from(path: Path | None, flags: FlightFlags, timing: Path | None = None) -> "Request":
    """The system or scenario of a file, an SSP with its timing, or the paper's scenario, with the flags applied."""
    from orchestration.quadrotor.scenarios.scenario import Scenario
    from orchestration.simulation.requests.request import FMU, load_request
    from orchestration.systems.system.request import system_of

    if path is not None and timing is None and path.suffix.lower() == FMU:
        from orchestration.command.one_fmu import OneFmuFlags  # which has these flags

        return OneFmuFlags().applied_to(path, flags)
    request = Scenario() if path is None else load_request(path, timing)
    if isinstance(request, Scenario):
        return flags.applied_to(request)
    return flags.applied_to_system(system_of(request))


def assigned(flag: str, texts: list[str] | None) -> dict[str, Any]:
    """The values of a repeated flag by name; raises `UsageError` for a text that is not NAME=VALUE."""
    return {key: _value(text) for key, text in _pairs(flag, texts or [])}


def _pairs(flag: str, texts: list[str]) -> list[tuple[str, str]]:
    pairs = []
    for text in texts:
        key, equals, value = text.partition("=")
        if key.strip() in ("controller.fmu", "plant.fmu"):
            side = key.strip().removesuffix(".fmu")
            raise UsageError(f"--{flag} {text}: expected a parameter; set the FMU by --{side} NAME|PATH")
        if not (key and equals and value):
            raise UsageError(f"--{flag} {text}: expected NAME=VALUE")
        pairs.append((key.strip(), value.strip()))
    return pairs


def _number(place: str, text: str, expected: str = "a number") -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{place} {text}: expected {without_unit(expected, text)}") from None


def _value(text: str) -> Any:
    """The value of a text: true or false, a number, an array, else the text itself, as always in quotes."""
    if text.startswith("["):
        return toml_of(f"value = {text}", text)["value"]
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    if len(text) > 1 and text[0] == text[-1] == '"':
        return text[1:-1]
    try:
        number = float(text)
    except ValueError:
        return text
    with suppress(ValueError):
        whole = int(text)
        if 2**53 <= abs(whole) < 2**63 or (abs(whole) < 2**64 and whole != int(number)):
            return whole  # as in a file: whether a float holds it, where that counts, is for the variable to say
    return number
