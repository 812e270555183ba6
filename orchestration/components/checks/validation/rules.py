"""All rules, by their subject and the FMUs that they apply to.

The tables of the documentation are made of their docstrings by `docs/website/rules.py`.
"""

from orchestration.components.checks.validation import (
    archive_rules,
    dependencies,
    description,
    other_interfaces,
    own_rules,
    reference_results,
    refusals,
    run_rules,
    structure,
    variables,
)
from orchestration.components.checks.validation.own_rules import own_description

OF_ARCHIVES = archive_rules.RULES
OF_DESCRIPTIONS = (
    *description.RULES,
    *variables.RULES,
    *structure.RULES,
)
OF_RUNS = (*run_rules.RULES, *structure.OF_RUNS, *reference_results.RULES)
"""Rules that rely on `run_rules.FIRST`"""
OF_EQUAL_RUNS = (*run_rules.COMPARED, *dependencies.RULES)
"""Rules for FMUs whose runs can be repeated"""
OF_OTHER_INTERFACES = other_interfaces.RULES
LAST_OF_RUNS = run_rules.LAST
"""Only rules of this project come after."""

OUR_DESCRIPTIONS = own_rules.RULES
OUR_RUNS = refusals.RULES

STANDARD = (
    *OF_ARCHIVES,
    description.standard,
    structure.indices,
    *OF_DESCRIPTIONS,
    *run_rules.FIRST,
    *OF_RUNS,
    *OF_EQUAL_RUNS,
    *OF_OTHER_INTERFACES,
    *LAST_OF_RUNS,
)
"""Rules for every FMU"""
OURS = (*OUR_DESCRIPTIONS, own_description, *OUR_RUNS)
"""Rules for those that quadcosim built"""
