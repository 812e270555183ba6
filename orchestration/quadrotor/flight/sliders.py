"""The numbers of a flight that its page lets a reader change."""

from collections.abc import Iterator

from orchestration.experiments.live.sliders import Slider, Sliders
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.paths import value_at
from orchestration.systems.system.request import Request

_CLOCK = (
    Slider(path="timing.period", words="Sampling period", low=0.001, high=0.2, group="Clock", logarithmic=True),
    Slider(path="timing.delay", words="Delay of commands", low=0.0, high=0.15, group="Clock"),
    Slider(path="timing.jitter", words="Jitter of samples", low=0.0, high=0.1, group="Clock"),
    Slider(path="timing.delay_jitter", words="Jitter of the delay", low=0.0, high=0.1, group="Clock"),
    Slider(path="timing.measurement_loss", words="Measurements lost", low=0.0, high=0.9, group="Clock"),
    Slider(path="timing.command_loss", words="Commands lost", low=0.0, high=0.9, group="Clock"),
    Slider(path="seed", words="Seed", low=0.0, high=20.0, group="Clock", whole=True),
)
_LAW = (
    Slider(path="controller.coupling", words="Coupling κ", low=0.0, high=15.0, group="Law"),
    Slider(path="controller.gain.eta", words="Gain η", low=1.0, high=40.0, group="Law", logarithmic=True),
    Slider(path="controller.gain.attitude", words="Gain of attitude", low=1.0, high=60.0, group="Law",
           logarithmic=True),
)  # fmt: skip
_WORLD = (
    Slider(path="plant.wind.amplitude.x", words="Wind, amplitude", low=0.0, high=10.0, group="World"),
    Slider(path="plant.initial.position.x", words="Start, north", low=-8.0, high=8.0, group="World"),
    Slider(path="plant.initial.position.y", words="Start, east", low=-8.0, high=8.0, group="World"),
    Slider(path="plant.mass", words="Mass of the vehicle", low=0.3, high=2.5, group="World"),
)


def sliders(request: Request) -> Sliders:
    """Those of the clock, and of what this controller and this plant have."""
    return Sliders(
        sliders=[*_there(request, (*_CLOCK, *_LAW, *_WORLD))], map=("timing.period", "timing.delay"),
        measure="ultimate_bound",
    )  # fmt: skip


def _there(request: Request, some: tuple[Slider, ...]) -> Iterator[Slider]:
    system = request.as_system()
    for slider in some:
        try:
            values = [value_at(system, path) for path in request.paths_of(slider.path)]
        except UsageError:
            continue
        if not any(isinstance(value, Distribution) for value in values):
            yield slider
