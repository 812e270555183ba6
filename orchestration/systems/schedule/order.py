"""The order of components at one instant: by their connections where possible, else as in the file."""

from collections.abc import Iterable, Sequence


def ranked(members: Sequence[str], before: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """`members` sorted so that the first of each pair in `before` precedes the second.

    Pairs are used in their order; one that would close a cycle with those before it is ignored. Members that no pair
    orders keep their given order.
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
