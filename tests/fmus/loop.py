"""Both FMUs in a closed loop, by the calls of a master that exchanges values between them."""

from dataclasses import dataclass

from tests.fmus.expected import COMMAND, MEASUREMENT
from tests.fmus.instance import Instance

MOTION = tuple(MEASUREMENT)


@dataclass(frozen=True)
class Loop:
    """A controller and a plant, wired by name."""

    controller: Instance
    plant: Instance

    @property
    def both(self) -> tuple[Instance, Instance]:
        """In the order of the steps of Gauss and Seidel."""
        return self.controller, self.plant

    def enter_initialisation(self) -> None:
        """Both into initialisation mode."""
        for instance in self.both:
            instance.fmu.setupExperiment(startTime=0.0)
            instance.fmu.enterInitializationMode()

    def exit_initialisation(self) -> None:
        """Both out of initialisation mode."""
        for instance in self.both:
            instance.fmu.exitInitializationMode()

    def measure(self) -> None:
        """The plant's motion to the controller."""
        self.controller.set(dict(zip(MOTION, self.plant.get(*MOTION), strict=True)))

    def command(self) -> None:
        """The controller's command to the plant."""
        self.plant.set(dict(zip(COMMAND, self.controller.get(*COMMAND), strict=True)))

    def fly(self, steps: int, h: float) -> list[list[str]]:
        """The controller before the plant; every variable of both after each step, to the last bit."""
        rows = []
        for k in range(steps):
            self.measure()
            self.controller.step(k * h, h)
            self.command()
            self.plant.step(k * h, h)
            rows.append(self.controller.everything() + self.plant.everything())
        return rows

    def fly_and_exchange_afterwards(self, first: int, last: int, h: float) -> None:
        """Both step on what they have, then all values go over at once."""
        for k in range(first, last):
            for instance in self.both:
                instance.step(k * h, h)
            command = self.controller.get(*COMMAND)
            self.measure()
            self.plant.set(dict(zip(COMMAND, command, strict=True)))
