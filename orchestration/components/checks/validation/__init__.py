"""Validation of FMUs: the archive, the description, and what the FMU does.

from orchestration.components.checks.validation.validator import validate

for finding in validate("fmus/QuadrotorPlant.fmu"):
    print(finding.rule, finding.text)
"""
