"""Validation of FMUs: the archive, the description, and what the FMU does.

from orchestration.checks.validation import validate

for finding in validate("fmus/QuadrotorPlant.fmu"):
    print(finding.rule, finding.text)
"""

from orchestration.checks.validation.finding import Finding
from orchestration.checks.validation.validator import validate

__all__ = ["Finding", "validate"]
