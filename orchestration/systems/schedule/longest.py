"""The limit of times: beyond it, whole nanoseconds need more than 64 bits."""

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import seconds
from orchestration.systems.system.component import Sampling
from orchestration.systems.system.computers import require_less
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.frames import ERROR_BITS, frame_nanoseconds
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import messages_by_connection, placed_messages, placed_tasks

MAX_TIME = 2**60
"""Latest time [ns], 36 years: the sum of a few of them still fits into 64 bits"""
MAX_AHEAD = 10**6
"""The largest delay of a measurement in samples: all of them are drawn before the first one"""


def expect_no_longer(system: System) -> None:
    """Raise `UsageError` for a time beyond `MAX_TIME`."""
    times = {"stop_time": system.stop_time}
    times |= {f"components.{name}.step": component.step or 0.0 for name, component in system.components.items()}
    times |= {f"sources.{name}.period": source.period or 0.0 for name, source in system.sources.items()}
    for name, component in system.components.items():
        if component.sampling is not None:
            _expect_jitter_within_period(name, component.sampling)
            for key in ("period", "offset"):
                place = f"components.{name}.sampling.{key}"
                times[place] = getattr(component.sampling, key) / component.sampling.clock_ratio
    for x in system.connections:
        times |= {f"connections.{x.name}.{key}": highest(getattr(x, key)) for key in ("delay", "delay_jitter")}
    for task in placed_tasks(system.computers):
        ratio = task.computer.clock_ratio
        if task.task.period is not None:
            require_less(f"{task.place}.jitter", task.task.jitter, task.task.period / ratio)
        times |= {f"{task.place}.{key}": (getattr(task.task, key) or 0.0) / ratio for key in ("period", "offset")}
        times |= {f"{task.place}.execution": highest(task.task.execution), f"{task.place}.deadline": task.task.due}
        times[f"computers.{task.computer_name}.switch"] = task.computer.switch
    for of in placed_messages(system.networks):
        if of.message.period is not None:
            require_less(f"{of.place}.jitter", of.message.jitter, of.message.period)
        times |= {f"{of.place}.{key}": getattr(of.message, key) or 0.0 for key in ("period", "offset", "deadline")}
        times[f"a frame of {of.place}"] = seconds(frame_nanoseconds(of.network, of.message, ERROR_BITS))
        times[f"networks.{of.network_name}.latency"] = of.network.latency
    for place, time in times.items():
        if time >= seconds(MAX_TIME):
            raise UsageError(f"{place} = {time:g} s: expected less than {seconds(MAX_TIME):.4g} s")
    over = messages_by_connection(system)
    for x in system.connections:
        sampling = system.components[x.receiver].sampling
        if sampling is None or system.components[x.sender].sampling is not None:
            continue
        period, late = sampling.period / sampling.clock_ratio, highest(x.delay) + highest(x.delay_jitter)
        if x.name in over:
            continue
        if late > MAX_AHEAD * period:
            raise UsageError(
                f"connections.{x.name}.delay: is measured {late:g} s before a sample of "
                f"{x.receiver}, every {period:g} s: expected at most {MAX_AHEAD} samples"
            )


def _expect_jitter_within_period(name: str, sampling: Sampling) -> None:
    try:
        sampling.expect_jitter_within_period()
    except UsageError as error:
        raise UsageError(f"components.{name}.sampling.{error}") from error
