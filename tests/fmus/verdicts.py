"""Who notices that an FMU is damaged: quadcosim, and the checkers of others."""

import logging
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from fmpy.validation import validate_fmu

from orchestration.components.checks.validation.finding import Finding
from orchestration.components.checks.validation.validator import validate
from orchestration.foundation.processes.resource_limits import Limits
from tests.fmus.damage import Mutant


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What the validators say of one mutant."""

    mutant: Mutant
    quadcosim: tuple[Finding, ...]
    fmpy: tuple[str, ...]
    fmutool: tuple[str, ...]


def fmpy_finds(fmu: Path) -> list[str]:
    """The problems that `fmpy validate` prints; what stops it is one too."""
    try:
        return [str(problem) for problem in validate_fmu(str(fmu))]
    except Exception as error:
        return [f"{type(error).__name__}: {error}"]


def fmutool_finds(fmu: Path) -> list[str]:
    """The errors that `fmutool -check` logs."""
    from fmu_manipulation_toolbox.checker import get_checkers
    from fmu_manipulation_toolbox.operations import FMU, FMUError

    errors: list[str] = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: errors.append(record.getMessage())  # type: ignore[method-assign]
    logger = logging.getLogger("fmu_manipulation_toolbox")
    logger.addHandler(handler)
    try:
        with FMU(str(fmu)) as opened:
            for checker in get_checkers():
                opened.apply_operation(checker())
    except FMUError as error:
        errors.append(error.reason)
    except Exception as error:
        errors.append(f"{type(error).__name__}: {error}")
    finally:
        logger.removeHandler(handler)
    return errors


def verdicts(mutants: Iterable[Mutant], built: Mapping[str, Path], folder: Path) -> list[Verdict]:
    """What quadcosim, fmpy and fmutool say of mutants of the FMUs `built`, by model, which are written to `folder`."""
    paths = {mutant: mutant.write(built[mutant.model], folder) for mutant in mutants}
    with ThreadPoolExecutor() as pool:
        own = pool.map(lambda mutant: validate(paths[mutant], limits=Limits(time=mutant.time_limit)), paths)
        return [
            Verdict(
                mutant=mutant,
                quadcosim=tuple(findings),
                fmpy=tuple(fmpy_finds(paths[mutant])),
                fmutool=tuple(fmutool_finds(paths[mutant])),
            )
            for mutant, findings in zip(paths, own, strict=True)
        ]


def as_markdown(tables: Mapping[int, Iterable[Verdict]]) -> str:
    """The table of who notices what, of mutants of each version of FMI."""
    by_mutant = [{verdict.mutant: verdict for verdict in table} for table in tables.values()]
    columns = [column for version in tables for column in (f"FMI {version}.0: quadcosim", "fmpy", "fmutool")]
    lines = [f"| damage | rule | {' | '.join(columns)} |", f"|---|---|{'---|' * len(columns)}"]
    for mutant in dict.fromkeys(mutant for of in by_mutant for mutant in of):
        cells = [cell for of in by_mutant for cell in _cells(of.get(mutant))]
        lines.append(f"| {mutant.name} | `{mutant.rule}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cells(verdict: Verdict | None) -> list[str]:
    """Whether each notices it; empty for what cannot be done to FMUs of that version."""
    if verdict is None:
        return [""] * 3
    found = any(finding.rule in (verdict.mutant.rule, verdict.mutant.rule_3) for finding in verdict.quadcosim)
    return ["yes" if each else "-" for each in (found, verdict.fmpy, verdict.fmutool)]
