"""The parameters of controllers whose command may be redesigned for the time during which it is held."""

import enum

from controller_fmu.interface import ControllerInterface
from fmu_kit.interface import FixedParameter


class Discretisation(enum.IntEnum):
    """How a law in continuous time is converted to a held command."""

    EXPLICIT = 1
    """the law at the sample"""
    SEMI_IMPLICIT = 2
    """the law at the sliding variable to which it leads at the end of the hold period"""
    MIDPOINT = 3
    """the law in the middle of the hold period"""
    MEAN = 4
    """the mean of the law over the hold period"""
    MATCH = 5
    """the constant command that leads to the same state as the law"""


class RedesignInterface(ControllerInterface):
    """How the command of a law is redesigned."""

    hold_period = FixedParameter(
        "T for which a command is held, as the redesign has it; 0: sample_period, and with that 0 the communication "
        "step",
        "s",
        0.0,
        minimum=0.0,
    )
    weight = FixedParameter(
        "weight w of discretisation match, of the attitude at the end of T in (w/T)^2 |dtheta|^2", "1", 1.0, minimum=0.0
    )
    prediction = FixedParameter(
        "delay to make up for, from sample to effect: the nominal model runs ahead; 0: none", "s", 0.0, minimum=0.0
    )
    discretisation = FixedParameter(
        "command that is held: the law at the sample (explicit), at the sliding variable that it leads to "
        "(semi_implicit), in the middle of T (midpoint), its mean over T (mean), or what leads where the law leads "
        "(match)",
        start=Discretisation.EXPLICIT,
    )
    stages = FixedParameter("steps of the nominal model over T", None, 3, minimum=1, maximum=100)
