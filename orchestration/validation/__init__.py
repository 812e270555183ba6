"""Validation of FMUs: the archive, the description, and what the FMU does.

from orchestration.validation import validate

for finding in validate("fmus/QuadrotorPlant.fmu"):
    print(finding.rule, finding.text)
"""

from orchestration.validation.finding import Finding
from orchestration.validation.validator import validate

__all__ = ["Finding", "validate"]
