"""What is found once of objects that many have in common."""

from orchestration.basics import identity
from orchestration.basics.identity import OfSame


def test_it_is_found_once_of_the_same_objects_and_anew_of_equal_ones() -> None:
    asked: list[list[int]] = []

    @OfSame
    def total(numbers: list[int], more: list[int]) -> int:
        asked.append(numbers)
        return sum(numbers) + sum(more)

    first, second, more = [1, 2], [1, 2], [3]
    assert [total(first, more), total(first, more), total(second, more), total(first, more)] == [6, 6, 6, 6]
    assert [each is first for each in asked] == [True, False]


def test_objects_that_are_gone_are_never_taken_for_those_in_their_place() -> None:
    @OfSame
    def content(of: list[int]) -> int:
        return of[0]

    assert [content([i]) for i in range(3 * identity.MOST)] == [*range(3 * identity.MOST)]


def test_of_many_objects_no_more_are_held_than_it_says() -> None:
    class Held:
        alive = 0

        def __init__(self) -> None:
            Held.alive += 1

        def __del__(self) -> None:
            Held.alive -= 1

    @OfSame
    def nothing(of: Held) -> None:
        pass

    for _ in range(3 * identity.MOST):
        nothing(Held())
    assert Held.alive <= identity.MOST
