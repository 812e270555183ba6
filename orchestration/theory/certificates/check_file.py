"""The check of a certificate's file: what it proves, and whether it is about a system."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from orchestration.foundation.basics.errors import UsageError, prefixed
from orchestration.foundation.basics.extras import needs
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.simulation.requests.request import RequestLike, request_of
from orchestration.theory.certificates.causes import ScheduledLoop
from orchestration.theory.certificates.certificate import Certificate, Checked, read_certificate
from orchestration.theory.certificates.certified_loop import LOSS, Varying
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.margin import cause_in, expect_without_scheduler, linear_loop_of, varying_of
from orchestration.theory.certificates.timeline import LoopTimeline
from orchestration.theory.stability.known_loops import rested

ROUNDING = 1e-12
"""Largest value that counts as 0, as a share of the largest entry of a row"""


class AnotherLoop(UsageError):
    """A certificate is about another loop than that of the system."""


@needs("flint")
def check_certificate(path: str | Path, request: RequestLike | None = None) -> Checked:
    """Verify the certificate of a file, and, with a system, that its matrices are those of that system's loop.

    Raises `QuadcosimError` for a certificate that proves nothing, `UsageError` for a file that is none and for one of
    another loop.
    """
    from orchestration.theory.certificates.verify_certificate import verified

    certificate = read_certificate(Path(path))
    proof, up_to = verified(certificate), None
    if request is not None:
        request = request_of(request)
        with prefixed(f"{path} is of another system: "):
            cause = cause_in(request, certificate.of[0]) if len(certificate.of) == 1 else None
        if cause is None:
            expect_without_scheduler(request)
            with prefixed(f"{path} is of another system: "):
                varying = [varying_of(request, of) for of in certificate.of]
            family = _family_for(certificate, LoopTimeline(linear_loop_of(request), varying), varying)
        else:
            scheduled = ScheduledLoop(linear_loop_of(request), rested(request), cause)
            up_to = scheduled.value_of(certificate.family)
            family = scheduled.family(up_to)
        try:
            expect_same_family(certificate, family)
        except AnotherLoop as error:
            raise AnotherLoop(f"{path}: {error}; expected the system, and the flags, with which it was made") from None
    return replace(proof, of=() if request is None else certificate.of, up_to=up_to)


def _family_for(certificate: Certificate, timeline: LoopTimeline, varying: list[Varying]) -> LoopFamily | None:
    """The family of a system for the ranges and runs of a certificate; None: the system has none."""
    own = certificate.family
    timed = sum(each.kind != LOSS for each in varying)
    if any(len(letter.ranges) != timed for letter in own.letters):
        raise AnotherLoop("other quantities vary in the certificate than at the paths that it names")
    most = own.largest()
    run = max(len(letter.moves) for letter in own.letters) - 1  # an arrival may follow any number of losses
    return timeline.family(most, run=run) if not most or sum(most) <= timeline.largest() else None


def expect_same_family(certificate: Certificate, family: LoopFamily | None) -> None:
    """Raise `AnotherLoop` where a certificate is not of that family, within the radius that its proof covers."""
    own = certificate.family
    if family is not None and (ours := _lasts(own)) != (other := _lasts(family)):
        raise AnotherLoop(f"it is of a loop with a period of {ours}, the system has {other}")
    if family is not None and certificate.basis is not None:
        family = family.in_basis(certificate.basis) if family.accepts(certificate.basis) else None
    if family is None or (family.kept, family.letters) != (own.kept, own.letters):
        raise AnotherLoop(
            "in a period of the system other events come, or at other times, as with another delay, offset, order or "
            "component"
        )
    if family.matrices.keys() != own.matrices.keys():
        raise AnotherLoop("the system has other events than the certificate")
    for name, theirs in family.matrices.items():
        if not _is_within(own.matrices[name], theirs, certificate.radius):
            raise AnotherLoop(
                f"{name}: the system's matrix is farther from the certificate's than the proof covers, as with another "
                "parameter"
            )


def _lasts(family: LoopFamily) -> str:
    """How long letters last, in words: the period, or its pieces."""
    found = {round(sum(f.times[0] for f in x.product if f.times is not None), 12) for x in family.letters}
    return " and ".join(quantity(each, "s") for each in sorted(found))


def _is_within(own: Floats, theirs: Floats, radius: float) -> bool:
    """Whether a matrix is in the set that the proof covers."""
    from orchestration.theory.certificates.verify_certificate import OF_THE_LARGEST

    if own.shape != theirs.shape:
        return False
    largest = np.abs(own).max(axis=1, keepdims=True)
    exact = (np.count_nonzero(own, axis=1) == 1)[:, None] & (own.sum(axis=1, keepdims=True) == 1.0)
    wide = np.where((own != 0.0) & ~exact, radius * (np.abs(own) + OF_THE_LARGEST * largest), ROUNDING * largest)
    return bool((np.abs(own - theirs) <= wide).all())
