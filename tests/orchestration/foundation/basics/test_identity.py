"""Results cached by the identity of their arguments."""

from orchestration.foundation.basics import identity
from orchestration.foundation.basics.identity import IdentityCache


def test_a_result_is_computed_once_for_the_same_objects_and_again_for_equal_ones() -> None:
    calls: list[list[int]] = []

    @IdentityCache
    def total(numbers: list[int], more: list[int]) -> int:
        calls.append(numbers)
        return sum(numbers) + sum(more)

    first, second, more = [1, 2], [1, 2], [3]
    assert [total(first, more), total(first, more), total(second, more), total(first, more)] == [6, 6, 6, 6]
    assert [each is first for each in calls] == [True, False]


def test_deleted_objects_are_never_mistaken_for_new_ones_at_their_address() -> None:
    @IdentityCache
    def content(of: list[int]) -> int:
        return of[0]

    assert [content([i]) for i in range(3 * identity.MAX_CACHED)] == [*range(3 * identity.MAX_CACHED)]


def test_no_more_objects_are_kept_alive_than_the_limit() -> None:
    class Held:
        alive = 0

        def __init__(self) -> None:
            Held.alive += 1

        def __del__(self) -> None:
            Held.alive -= 1

    @IdentityCache
    def nothing(of: Held) -> None:
        pass

    for _ in range(3 * identity.MAX_CACHED):
        nothing(Held())
    assert Held.alive <= identity.MAX_CACHED
