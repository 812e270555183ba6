"""The panels of a flight in a report, and the scene of its vehicle in space."""

from collections.abc import Collection, Iterator, Mapping, Sequence

from fmu_kit.frames import Frame
from orchestration.experiments.report.model import Line, Panel, Scene
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios import wiring
from orchestration.quadrotor.scenarios.measures import position_error
from orchestration.systems.system.model import System

POSITION_ERROR = "position error"
"""A computed column: ‖P - P_d‖ [m]"""
ANGLES = ("roll", "pitch", "yaw")
"""Columns that the page computes from the quaternion [deg]"""
DESIRED_ANGLES = tuple(f"{angle} of the reference" for angle in ANGLES)
"""likewise from the desired one"""
OF_REFERENCE = ("x of the reference", "y of the reference", "z of the reference")


def _of_plant(names: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"plant.{name}" for name in names)


PLACE, ATTITUDE = _of_plant(wiring.POSITION), _of_plant(wiring.QUATERNION)
DESIRED = tuple(f"controller.{name}" for name in wiring.components("desired_quaternion", "xyzw"))
"""Q_d as of the last sample, of controllers with this output"""
THRUST, TORQUE = f"plant.{wiring.COMMAND[0]}", _of_plant(wiring.components("torque"))


class FlightLayout:
    """The layout of runs with the columns of a quadrotor."""

    compact = (*_of_plant((*wiring.POSITION, *wiring.QUATERNION, *wiring.ANGULAR_VELOCITY, *wiring.COMMAND)), *DESIRED)
    logarithmic = (POSITION_ERROR,)

    def fits(self, columns: Collection[str]) -> bool:
        """Whether position and attitude of a vehicle are among the columns."""
        return {*PLACE, *ATTITUDE} <= {*columns}

    def computed(self, signals: Mapping[str, Floats]) -> dict[str, Floats]:
        """The position error, where there is a reference."""
        return {POSITION_ERROR: position_error(signals)} if _has_reference(signals) else {}

    def panels(self, columns: Collection[str]) -> tuple[Panel, ...]:
        """Errors, position, attitude, commands and rates; velocity and energy, closed at first."""
        has_reference, has_desired_attitude = _has_reference(columns), {*DESIRED} <= {*columns}
        panels = [
            Panel(
                title="position error",
                unit="m",
                lines=(Line(column=POSITION_ERROR, label="‖P − P_d‖"),),
                logarithmic=True,
            ),
            Panel(
                title="position",
                unit="m",
                lines=(
                    *_vector(PLACE, "xyz"),
                    *(_vector(wiring.POSITION_REFERENCE, OF_REFERENCE, reference=True) if has_reference else ()),
                ),
            ),
            Panel(
                title="attitude",
                unit="°",
                lines=(
                    *_vector(ANGLES, ANGLES),
                    *(
                        _vector(DESIRED_ANGLES, DESIRED_ANGLES, held=True, reference=True)
                        if has_desired_attitude
                        else ()
                    ),
                ),
            ),
            Panel(title="thrust", unit="N", lines=(Line(column=THRUST, label="thrust", held=True),)),
            Panel(title="torque", unit="N·m", lines=(*_vector(TORQUE, "xyz", held=True),)),
            Panel(title="angular velocity", unit="rad/s", lines=(*_vector(_of_plant(wiring.ANGULAR_VELOCITY), "xyz"),)),
            Panel(title="velocity", unit="m/s", lines=(*_vector(_of_plant(wiring.VELOCITY), "xyz"),), shown=False),
            Panel(
                title="energy", unit="J", lines=(Line(column=f"controller.{wiring.ENERGY}", label="L", held=True),),
                logarithmic=True, shown=False,
            ),
        ]  # fmt: skip
        known = {*columns, *ANGLES, *DESIRED_ANGLES, *([POSITION_ERROR] if has_reference else [])}
        return tuple(panel for panel in panels if all(line.column in known for line in panel.lines))

    def scene(self, columns: Collection[str], system: System | None) -> Scene | None:
        """The vehicle and its reference."""
        parameters = {} if system is None else system.components["plant"].parameters
        return Scene(
            position=(PLACE[0], PLACE[1], PLACE[2]),
            quaternion=(ATTITUDE[0], ATTITUDE[1], ATTITUDE[2], ATTITUDE[3]),
            reference=(wiring.POSITION_REFERENCE[0], wiring.POSITION_REFERENCE[1], wiring.POSITION_REFERENCE[2])
            if _has_reference(columns)
            else None,
            desired=(DESIRED[0], DESIRED[1], DESIRED[2], DESIRED[3]) if {*DESIRED} <= {*columns} else None,
            thrust=THRUST if THRUST in columns else None,
            is_enu=parameters.get("frame") in ("enu", Frame.ENU) or parameters.get("frame_index") == Frame.ENU,
        )


def _has_reference(columns: Collection[str]) -> bool:
    return all(name in columns for name in wiring.POSITION_REFERENCE)


def _vector(
    columns: Sequence[str], labels: Sequence[str], *, held: bool = False, reference: bool = False
) -> Iterator[Line]:
    for column, label in zip(columns, labels, strict=True):
        yield Line(column=column, label=label, held=held, reference=reference)


LAYOUT = FlightLayout()
