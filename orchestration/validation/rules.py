"""Every rule, by what it looks at and whose FMUs it is for."""

from orchestration.validation import (
    archive,
    dependencies,
    description,
    house,
    refusals,
    runs,
    structure,
    units,
    variables,
)
from orchestration.validation.own_description import own_description

OF_ARCHIVES = archive.RULES
OF_DESCRIPTIONS = (*description.RULES, *variables.RULES, *units.RULES, *structure.RULES)
OF_RUNS = runs.RULES
"""After `runs.FIRST`, without which they cannot be tried."""
OF_EQUAL_RUNS = (*runs.COMPARED, *dependencies.RULES)
"""For FMUs whose runs can be repeated."""

OUR_DESCRIPTIONS = house.RULES
OUR_RUNS = refusals.RULES

STANDARD = (*OF_ARCHIVES, description.standard, *OF_DESCRIPTIONS, *runs.FIRST, *OF_RUNS, *OF_EQUAL_RUNS)
"""For every FMU."""
OURS = (*OUR_DESCRIPTIONS, own_description, *OUR_RUNS)
"""For those that quadcosim built."""
