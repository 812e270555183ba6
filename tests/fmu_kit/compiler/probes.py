"""Slaves that do what slaves may do and be written out as C, each some of it."""

import enum
import math
from dataclasses import dataclass
from typing import NamedTuple

from fmu_kit import interface
from fmu_kit.algebra import Vec3
from fmu_kit.errors import DivergenceError, FmuError, require
from fmu_kit.interface import FixedParameter, Input, Output, Parameter
from fmu_kit.saved_state import State
from fmu_kit.scalar import repeat
from fmu_kit.slave import Slave


class Mode(enum.IntEnum):
    """Items of an Enumeration."""

    AS_IT_IS = 1
    TURNED = 2
    DOUBLED = 3


class Probe(Slave):
    """What all have: inputs a, b, n, on; parameters p, q, times, mode; outputs y0 to y7, count, lit."""

    a = Input("A number.", None)
    b = Input("A number.", None)
    p = Parameter("A parameter.", None, 1.5, minimum=-100.0, maximum=100.0)
    q = FixedParameter("A parameter.", None, 0.25, above=0.0)
    y0, y1, y2, y3, y4, y5, y6, y7 = (Output("A number.", None, variability="continuous") for _ in range(8))
    n = Input("A whole number.", None, 3, variability="discrete")
    count = Output("A whole number.", None, 0)
    on = Input("A truth value.", None, False, variability="discrete")
    lit = Output("A truth value.", None, False)
    times = FixedParameter("How often.", None, 2, minimum=0, maximum=9)
    mode = Parameter("What becomes of it.", None, Mode.TURNED)

    def internal_state(self) -> State:
        """Not what these are about."""
        return {}


# -- branches ----------------------------------------------------------------------------------------------------


def _step_of_stairs(x: float) -> float:
    if x < -1.0:
        return -1.0
    elif x < 0.0:
        return x
    elif not x < 5.0:
        return 7.0
    for edge in (1.0, 2.0, 3.0):
        if x < edge:
            return edge
    return 4.0


def _of_two(x: float, y: float, *, most: float = 2.0) -> tuple[float, bool]:
    low, high = (x, y) if x < y else (y, x)
    if low <= 0.0 <= high and low != high:
        return min(high, most), True
    return low, low > most or high < -most


class Branches(Probe):
    """if, elif, else, early returns, conditions of several parts, functions that branch and call each other."""

    description = "Branches."

    def initialise(self, t: float) -> None:
        """Outputs of the inputs."""
        self.step(t, 1.0)

    def step(self, t: float, h: float) -> None:
        """All kinds of branches, in several methods: paths through one method multiply."""
        a, b = self.a, self.b
        self.y0 = _step_of_stairs(a) + 10.0 * _step_of_stairs(b)
        value, both = _of_two(a, b)
        self.y1 = value
        self.y2 = _of_two(_step_of_stairs(b), a, most=self.p)[0]
        self._choose(a, b, both)
        self._leave_early(a, b, t, h)
        self._combine(a, b, both)

    def _choose(self, a: float, b: float, both: bool) -> None:
        """if and elif without an else."""
        if both and (a > 1.0 or b > 1.0) and self.on:
            self.y3 = a
        elif self.n > 2 and a != b:
            self.y3 = b

    def _leave_early(self, a: float, b: float, t: float, h: float) -> None:
        """From within a branch."""
        if a > b:
            self.y4 = t
            if self._is_small(a):
                self.y5 = h
                return
            self.y5 = -h
        self.y3 = self.y3 + 1.0

    def _combine(self, a: float, b: float, both: bool) -> None:
        """Conditions within values."""
        self.y6 = 1.0 if -1.0 < a < b <= 3.0 else 2.0
        self.y7 = (a or b) + (1 if a and b else 0)
        self.lit = any((a > 3.0, b > 3.0)) and not all(self._is_large(x) for x in (a, b))
        self.count = self.n + (2 if self.on else -1) + both

    def _is_large(self, x: float) -> bool:
        """Nothing but a truth value: it may be asked for in vain."""
        return (x if x > 0.0 else -x) > self.q + 0.75

    def _is_small(self, x: float) -> bool:
        """A method with a separate truth value."""
        if x < 0.0:
            return self._is_small_and_positive(-x)
        return self._is_small_and_positive(x)

    def _is_small_and_positive(self, x: float) -> bool:
        return 0.0 <= x < self.q


# -- arithmetic ----------------------------------------------------------------------------------------------------


class Arithmetic(Probe):
    """Operations that Python refuses for some numbers."""

    description = "Arithmetic."

    def step(self, t: float, h: float) -> None:
        """One of them, by the number n."""
        a, b, n = self.a, self.b, self.n
        i, k = (math.floor(min(max(x, -1e6), 1e6)) for x in (a, b))
        if n == 0:
            self.y0 = a / b
        elif n == 1:
            self.y0 = a % b
        elif n == 2:
            self.y0 = a**b if a >= 0.0 else a**3
        elif n == 3:
            self.y0 = math.sqrt(a)
        elif n == 4:
            self.y0 = math.exp(a) + math.expm1(b)
        elif n == 5:
            self.y0 = math.log(a)
        elif n == 6:
            self.y0 = math.asin(a) + math.acos(b)
        elif n == 7:
            self.count = math.ceil(b / 1e305) + i % 7
        elif n == 8:
            self.y0 = math.pow(a, b)
        elif n == 9:
            self.y0 = a // b
        elif n == 10:
            self.count = i // 3 + k % -5 + 7 // k
        elif n == 11:
            self.y0 = (a * 1e200) * (b * 1e200)
            require(math.isfinite(self.y0), "y0", self.y0, "a finite value")
        self.y1 = abs(a) + math.fabs(b) - math.copysign(a, b)
        self.y2 = math.sin(a) + math.cos(b) + math.tan(a) + math.tanh(b)
        self.y3 = math.atan(a) + math.atan2(a, b)
        self.y4 = min(a, b, 0.5) + max((a, b))
        self.y5 = a**2 - b**-2.0 if b else a**0.5 if a > 0.0 else -a + +b
        self.y6 = float(math.isnan(a / 2.0)) + (a == b) + float(n) + (n * n - n // 2) / 4
        self.y7 = sum((a, b, 1.0, -a / 3.0, n))


class Zeros(Slave):
    """The smaller and the larger of two."""

    a = Input("A number.")
    b = Input("Another.")
    small = Output("The smaller one.")
    large = Output("The larger one.")

    def step(self, t: float, h: float) -> None:
        """The first of two that are equal."""
        self.small = min(self.a, self.b)
        self.large = max(self.a, self.b)


class Rare(Probe):
    """Functions that a few arguments make go another way, far from zero or at it, of what is kept."""

    description = "Rare arguments."

    def initialise(self, t: float) -> None:
        """Nothing is there yet."""
        self._turned, self._power = 0.0, 0.0

    def step(self, t: float, h: float) -> None:
        """A power of a, and sines."""
        require(self.b != -1.0, "b", self.b, "another number")
        self._power = 0.5 * self._power + abs(self.a) ** self.p
        self._turned = 0.5 * self._turned + math.sin(self.b) + math.cos(self.b) + math.cos(self.a)
        self.y0, self.y1 = self._power, self._turned


# -- whole numbers -------------------------------------------------------------------------------------------------


def _mixed(x: int) -> int:
    """Xorshift of 32 bits."""
    x = (x ^ (x << 13)) & 0xFFFFFFFF
    x ^= x >> 17
    return (x ^ (x << 5)) & 0xFFFFFFFF


def _larger(x: int, y: int) -> int:
    return x * x if x > y else x * y


class Integers(Probe):
    """Generators of pseudo-random numbers, and all else that whole numbers may be used for."""

    description = "Integers."

    def initialise(self, t: float) -> None:
        """What is kept."""
        self._congruential = 12345
        self._shifted = 2463534242
        self._large = 9007199254740991
        self._seen = 0

    def step(self, t: float, h: float) -> None:
        """Each in turn."""
        n, on = self.n, self.on
        self._congruential = (self._congruential * 1103515245 + 12345) % 2147483648
        self._shifted = _mixed(self._shifted + n)
        self._seen += 1
        self._large = (self._large * (self._large - n)) % (9007199254740881 if on else -9007199254740847)
        self.y0 = self._congruential / 2147483648
        self.y1 = float(self._shifted)
        self.y2 = self._large
        self.y3 = self._small(n, on)
        self.y4 = math.atan2(0.0, -n * (n - 3)) + math.copysign(1.0, (n * 0) * -1.0) + math.copysign(1.0, -(n - n))
        self.y5 = ((self._congruential << 40) // (7 * n + 11) >> 20) + (self._shifted * self._large) // 2**70
        self.y6 = repeat(self.times, lambda i, x: (x * (2**40 + i) + 1) % 1000003, n)
        self.count = (_larger(self._shifted >> 8, self._congruential >> 8) + n**3) % 1000
        self.lit = (self._large * n > self._shifted * self._large) ^ on
        if self.a > 2.0:
            self.warn_once("a", f"{self._large} and {self._shifted * 2:d}, {-n * 0}, {2**53 - 1 - self._seen}")

    def _small(self, n: int, on: bool) -> int:
        """Of few bits."""
        return (
            (n & 5) + 10 * (n | 8) + 100 * (n ^ -3) + 1000 * ~n + 10000 * (n >> 1) + abs(n << 3) + (on & n) + (on ^ 1)
        )


# -- choices -------------------------------------------------------------------------------------------------------


def _chosen(x: float, mode: int) -> float:
    if mode == Mode.AS_IT_IS:
        return x
    return -x if mode == Mode.TURNED else 2.0 * x


class Choices(Probe):
    """Branches on an Enumeration, and on a whole number that is a parameter."""

    description = "Choices."

    def read_parameters(self) -> None:
        """One that is known from the parameters alone."""
        self._offset = 10.0 if self.mode >= Mode.TURNED else 0.0

    def initialise(self, t: float) -> None:
        """Outputs of the inputs."""
        self.step(t, 1.0)

    def step(self, t: float, h: float) -> None:
        """In a function, in a method and as a number."""
        mode = self.mode
        self.y0 = _chosen(self.a, mode) + self._offset
        self.y1 = repeat(self.times, lambda i, x: _chosen(x, mode), self.b)
        if mode != Mode.DOUBLED and self.times > 1:
            self.y2 = t
        self.count = 10 * mode + self.times


# -- what is kept ----------------------------------------------------------------------------------------------------


@dataclass
class Filter:
    """An object that is changed in place."""

    value: float
    seen: int = 0

    def take(self, x: float, share: float) -> float:
        """Towards x; far from it in one go."""
        self.seen += 1
        if abs(x - self.value) > 50.0:
            self.value = x
        else:
            self.value += share * (x - self.value)
        return self.value


class Pair(NamedTuple):
    """Of numbers."""

    first: float
    second: float


def _raise_all(values: list[float], by: float) -> None:
    for k in range(len(values)):
        if values[k] < by:
            values[k] = by


class Memory(Probe):
    """Objects, lists, dictionaries and tuples from step to step, changed in place and put anew."""

    description = "Memory."

    def read_parameters(self) -> None:
        """Only if they are what they have to be together."""
        self._share = self.q / (1.0 + abs(self.p))
        require(self.p != 13.0, "p", self.p, "another number")

    def initialise(self, t: float) -> None:
        """All that is kept has its shape from here on."""
        self._filters = [Filter(self.a), Filter(0.0, seen=10)]
        self._named = {"low": math.inf, "high": -math.inf}
        self._last = Pair(self.a, self.b)
        self._whole: float = 0
        self._delayed = [0.0] * 4
        self._armed = False
        self._started = t

    def step(self, t: float, h: float) -> None:
        """Some of each."""
        a, b = self.a, self.b
        chosen = self._filters[0]
        if self.on:
            chosen = self._filters[1]
            self._last = Pair(b, self._last.first)
        self.y0 = self._filters[0].take(a, self._share)
        self.y1 = self._filters[1].take(chosen.value + b, self._share)
        if a < self._named["low"]:
            self._named["low"] = a
        self._named["high"] = max(self._named["high"], b)
        self.y2 = self._last.second - self._last.first
        self._delayed = [a, *self._delayed[:-1]]
        _raise_all(self._delayed, -2.0)
        self._delayed[1] += 0.0
        self.y3 = self._delayed[3]
        self._whole += 0.5 if self._armed else 1
        self.y4 = math.floor(self._whole)
        self._armed = a > b or (self._armed and a > 0.0)
        self.lit = self._armed
        self.count = self._filters[0].seen + self._filters[1].seen
        self.y5 = t - self._started
        if self._named["low"] <= self._named["high"]:
            self.y6 = self._named["high"] - self._named["low"]


class Kept(Probe):
    """What is set in `__init__`, methods of its own class and of its base under one name."""

    description = "Kept."

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        self._total = 2.5
        self._offset = Vec3(1.0, 2.0, 3.0)

    def initialise(self, t: float) -> None:
        """Not the total: that begins with what it was made with, and goes on."""
        self._offset = Vec3(self.a, self._total, 3.0)

    def step(self, t: float, h: float) -> None:
        """Both ways of moving."""
        self.y0 = self._moved(self.a, self.b)
        self.y1 = self._listed(self.a, self.b, self._total)
        self._total = self._total + h
        self.y2 = self._total + self._offset.x * self._offset.y

    def _moved(self, x: float, by: float) -> float:
        return x + by if x > by else x

    def _listed(self, *values: float) -> float:
        return max(values)


class Below(Kept):
    """A class of a class."""

    description = "Below."

    def step(self, t: float, h: float) -> None:
        """Its own, and around that of its base."""
        super().step(t, h)
        self.y3 = self._moved(self.b, 1.0)
        self.y4 = super()._moved(self.b, 1.0)

    def _moved(self, x: float, by: float) -> float:
        return 2.0 * super()._moved(x, by) + super()._moved(by, x)


class Pendulum(Slave):
    """States, and what is computed of them at the start without a word to the base class."""

    torque = Input("applied", "N.m")
    angle = interface.State("from the vertical", "rad", 0.5)
    place = interface.State("of the bob", "m", Vec3(0.0, 1.0, 2.0))
    height = Output("of the bob", "m")
    length = Parameter("of the rod", "m", 2.0)

    def initialise(self, t: float) -> None:
        """The height of where it starts."""
        self.height = self.length * math.cos(self.angle) + self.place.y

    def step(self, t: float, h: float) -> None:
        """Somewhere."""
        self.angle = self.angle + h * self.torque
        self.height = self.length * math.cos(self.angle)


# -- loops ---------------------------------------------------------------------------------------------------------


def _clipped(x: float) -> float:
    return 10.0 if x > 10.0 else x


def _either_way(times: int, x: float, by: float) -> float:
    if x > 1.0:
        return repeat(times, lambda i, y: y - by, x)
    return repeat(times, lambda i, y: y * by, x)


class Loops(Probe):
    """Loops of a computed number of times."""

    description = "Loops."

    def step(self, t: float, h: float) -> None:
        """A sum, a product that is cut off, one loop in another."""
        a, b, n = self.a, self.b, self.n
        times = min(max(n, 0), 20)

        def add(i: int, state: tuple[float, float]) -> tuple[float, float]:
            total, product = state
            if i > 2:
                total = total + a
            return total + i * b, _clipped(product * a)

        total, product = repeat(times, add, (0.0, 1.0))
        self.y0 = total
        self.y1 = product
        nothing: float = 0
        inner = repeat(times, lambda i, x: x + repeat(i, lambda k, y: y + k * b, 0.0), nothing)
        self.y2 = inner
        half = repeat(times, lambda i, x: x + 0.5, nothing)
        self.count = math.floor(half)

        def root(i: int, x: float) -> float:
            require(x > -3.0, "root", x, "more than -3")
            return x - 1.0

        self.y3 = repeat(times, root, abs(b))
        self.y4 = repeat(times, lambda i, x: self._nearer(x, i + self._nearer(x, 1.0)), a)
        self.y5 = self._nearer(b, 2.0)
        self.y6 = self._turned(times, a)

    def _turned(self, times: int, x: float) -> float:
        return _either_way(times, x, math.exp(0.01 * self.p))

    def _nearer(self, x: float, far: float) -> float:
        """Half of the way from one number to another, by what this step has put."""
        require(far != 17.0, "far", far, "another number than 17")
        return x if far < 0.0 else x + 0.5 * (far - x) * self.p / (1.0 + abs(self.y0))


# -- words ---------------------------------------------------------------------------------------------------------


class Words(Probe):
    """Errors and warnings, with values in them."""

    description = "Words."

    def read_parameters(self) -> None:
        """Errors of parameters."""
        if self.p > 50.0:
            raise FmuError(f'p = {self.p:g}, which is 100 % more than {50:d}: expected "less" \\ µ')

    def step(self, t: float, h: float) -> None:
        """Warnings once, then errors."""
        a, b, n = self.a, self.b, self.n
        if a > 1.0:
            self.warn_once("a", f"a = {a} and {b:g} at t = {t}: 100 % of {n}, {self.on}, {a > b}")
        if b > 1.0:
            self.warn_once("b", f"b = {b:.3f}, {b:.2e}, {a:.4g}, {-b!r}, {float(n)}, {math.floor(b)}, {n:d}")
        if a > 1.0 and b > 1.0:
            self.warn_once("a", "never")
        if n == 7:
            raise DivergenceError(f"at t = {t}: n = {n}, {(a, b)}, {[a]}")
        require(n != 8, "n", n, f"another number than {n + 0.5}")
        if n == 9:
            raise ValueError(f"n is {n}")
        self.y0 = a
