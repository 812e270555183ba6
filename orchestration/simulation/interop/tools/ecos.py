"""Ecos, through ecospy."""

import ctypes
import sys
from importlib.metadata import files
from typing import Any

from orchestration.simulation.interop.job import Job, Rows
from orchestration.simulation.requests.ssp.names import PARAMETER_SET


def _load_tbb() -> None:
    """Load oneTBB, to which the library of ecospy links, from its pip package; else it is not found."""
    if sys.platform != "linux":
        return
    found = [file.locate() for file in files("tbb") or [] if file.name == "libtbb.so.12"]
    if not found:
        raise ModuleNotFoundError("tbb: has no libtbb.so.12", name="tbb")
    ctypes.CDLL(str(found[0]), mode=ctypes.RTLD_GLOBAL)


_load_tbb()

from ecospy import EcosSimulation, EcosSimulationStructure  # noqa: E402  # after oneTBB
from ecospy.EcosSimulation import SimulationListener  # noqa: E402
from ecospy.lib import EcosLib  # noqa: E402


def run(job: Job) -> Rows:
    """With connections made one by one, and a parameter set."""
    structure = EcosSimulationStructure()
    for name, path in job.fmus.items():
        structure.add_model(name, path)
    for (start, output), (end, target) in job.connections:
        structure.make_real_connection(f"{start}::{output}", f"{end}::{target}")
    structure.add_parameter_set(
        PARAMETER_SET, {f"{name}::{key}": value for name, set in job.parameters.items() for key, value in set.items()}
    )
    return _record(EcosSimulation(job.step, structure=structure), job)


def run_ssp(job: Job) -> Rows:
    """From the SSP, its parameter set by name."""
    return _record(EcosSimulation(job.step, ssp_path=str(job.ssp)), job)


def _record(simulation: EcosSimulation, job: Job) -> Rows:
    recorder = _Recorder(simulation, job)
    with simulation:
        simulation.add_listener("recorder", recorder)
        if not simulation.init(parameter_set=PARAMETER_SET):
            raise RuntimeError(f"ecos: {EcosLib.get_last_error()}")
        simulation.step_until(job.stop)
        simulation.terminate()
    return recorder.rows


class _Recorder(SimulationListener):  # type: ignore[misc]
    """Reads the signals after each step."""

    def __init__(self, simulation: EcosSimulation, job: Job) -> None:
        self.rows: Rows = []
        self._simulation = simulation
        self._names = [signal.replace(".", "::", 1) for signal in job.signals]

    def post(self, info: Any) -> None:
        """After a step."""
        self.rows.append([self._simulation.get_time(), *map(self._simulation.get_real, self._names)])
