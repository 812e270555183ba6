"""Scenarios as a kind of request."""

from orchestration.quadrotor.scenarios.file import scenario_from_tables
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.translation import SYSTEM
from orchestration.simulation.requests.kinds import RequestKind

SCENARIOS = RequestKind(default=Scenario, from_tables=scenario_from_tables, files=(SYSTEM,))
