"""The points of a study at which the tasks of a processor ask for more time than there is."""

from collections.abc import Mapping

from orchestration.experiments.studies.design_points import DesignPoints, Point
from orchestration.experiments.studies.study import StartValues, Study
from orchestration.systems.schedule.overload import Overload, overloads, worst_in_words
from orchestration.systems.system.placement import placed_tasks

MAX_POINTS, MAX_SCHEDULES = 1000, 50
"""Points that are looked at, and those if jobs are released by messages, whose number a schedule tells"""


def overloads_in_words(study: Study, starts: StartValues, units: Mapping[str, str]) -> list[str]:
    """A warning for each processor that is overloaded, with the points and the largest demand there."""
    computers = study.origin.computers
    if not computers:
        return []
    most = MAX_SCHEDULES if any(each.task.on is not None for each in placed_tasks(computers)) else MAX_POINTS
    points, found = DesignPoints(study), dict[str, dict[Point, Overload]]()
    for point, index in [*points.firsts.items()][:most]:
        for one in overloads(study.system(index, starts)):
            found.setdefault(one.name, {})[point] = one
    at_least = "at least " if len(points.firsts) > most else ""
    texts = []
    for by_point in found.values():
        where, text = points.where(by_point, units), worst_in_words([*by_point.values()], several=len(by_point) > 1)
        texts.append(f"{at_least}{where.lstrip()}: {text}" if where else text)
    return texts
