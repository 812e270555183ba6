"""Who comes first at one instant: an order that follows the connections where it can, and the file where it cannot."""

from collections.abc import Iterable, Sequence


def ranked(members: Sequence[str], before: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """`members` so that the first of each pair in `before` precedes the second.

    Pairs are taken in their order; one that would close a circle with those before it is left out. Members that
    no pair puts in order keep the order in which they are given.
    """
    followers: dict[str, set[str]] = {member: set() for member in members}
    for first, second in before:
        if first in followers and second in followers and not _reaches(followers, second, first):
            followers[first].add(second)
    waiting = {member: sum(member in after for after in followers.values()) for member in members}
    result: list[str] = []
    while waiting:
        chosen = next(member for member, count in waiting.items() if count == 0)
        del waiting[chosen]
        result.append(chosen)
        for follower in followers[chosen]:
            waiting[follower] -= 1
    return tuple(result)


def _reaches(followers: dict[str, set[str]], start: str, end: str) -> bool:
    seen, stack = set(), [start]
    while stack:
        member = stack.pop()
        if member == end:
            return True
        if member not in seen:
            seen.add(member)
            stack.extend(followers[member])
    return False
