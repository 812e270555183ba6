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

OF_ARCHIVES = (*archive.RULES, description.standard)
OF_DESCRIPTIONS = (*description.RULES, *variables.RULES, *units.RULES, *structure.RULES)
OF_RUNS = (*runs.RULES, *dependencies.RULES)
"""After `runs.FIRST`, without which they cannot be tried."""

OUR_DESCRIPTIONS = house.RULES
OUR_RUNS = refusals.RULES

STANDARD = (*OF_ARCHIVES, *OF_DESCRIPTIONS, *runs.FIRST, *OF_RUNS)
"""For every FMU."""
OURS = (*OUR_DESCRIPTIONS, own_description, *OUR_RUNS)
"""For those that quadcosim built."""
