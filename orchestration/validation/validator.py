"""All rules, in the order in which one needs what the ones before it found out."""

import tempfile
from pathlib import Path

from orchestration.validation import rules
from orchestration.validation.archive import UnreadableError, can_be_unpacked, read_archive
from orchestration.validation.finding import Finding, check, name_of
from orchestration.validation.fmu import Fmu, read_fmu

READABLE = "readable"
TIME_LIMIT = 60.0
"""[s]; for what the FMU does"""


def validate(path: str | Path, *, time_limit: float = TIME_LIMIT) -> list[Finding]:
    """What is wrong with the FMU for co-simulation (FMI 2.0) at `path`; nothing for one that is as it should be.

    The FMU is run, in a process of its own that gets `time_limit` seconds. Rules that are this project's and
    not the standard's are for FMUs that quadcosim built. Raises `QuadcosimError` if the validation fails itself.
    """
    findings: list[Finding] = []
    try:
        content = read_archive(Path(path))
        findings += check(rules.OF_ARCHIVES, content)
        fmu = read_fmu(content)
    except UnreadableError as error:
        return [*findings, Finding(READABLE, str(error))]
    findings += check(rules.OF_DESCRIPTIONS, fmu)
    if fmu.is_ours:
        findings += check(rules.OUR_DESCRIPTIONS, fmu)
    if can_be_unpacked(content):
        findings += _of_what_it_does(fmu, time_limit)
    return findings


def _of_what_it_does(fmu: Fmu, time_limit: float) -> list[Finding]:
    import fmpy

    from orchestration.fmpy_adapter import expect_readable_place
    from orchestration.validation.behaviour import behaviour
    from orchestration.validation.own_description import own_description

    with tempfile.TemporaryDirectory(prefix="quadcosim-", ignore_cleanup_errors=True) as folder:
        fmpy.extract(str(fmu.archive.path), folder)
        expect_readable_place(Path(folder))
        own = own_description(fmu, Path(folder), time_limit) if fmu.is_ours else ()
        return [
            *(Finding(name_of(own_description), text) for text in own),
            *behaviour(fmu, Path(folder), time_limit),
        ]
