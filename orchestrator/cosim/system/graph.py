"""The graph of what waits for what: rings in it, and orders that open them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

#: What each component waits for: the components whose direct feedthrough feeds it.
Sources = Mapping[str, Collection[str]]


def without_rings(sources: Sources) -> dict[str, set[str]]:
    """What each waits for once all rings are opened: in a ring, for the one before it."""
    place = {name: i for i, name in enumerate(sources)}
    found: dict[str, set[str]] = {}
    for part in strongly_connected(sources):
        before: set[str] = set()
        ring = set(part)
        for name in opened(part, sources, place):
            found[name] = {source for source in sources[name] if source not in ring} | before
            before = {name}
    return {name: found[name] for name in sources}


def in_levels(sources: Sources, last: Collection[str]) -> list[str]:
    """The components of a graph without rings: first those that wait for nothing, and so on.

    Some come last, when nothing else is left that does not wait for them.
    """
    missing = {name: len(feeding) for name, feeding in sources.items()}
    fed: dict[str, list[str]] = {name: [] for name in sources}
    for name, feeding in sources.items():
        for source in feeding:
            fed[source].append(name)
    place = {name: i for i, name in enumerate(sources)}
    order: list[str] = []
    ready = [name for name, n in missing.items() if n == 0]
    later: list[str] = []
    while ready or later:
        level = [name for name in ready if name not in last]
        later += [name for name in ready if name in last]
        if not level:
            level, later = later, []
        level.sort(key=place.__getitem__)
        order += level
        ready = []
        for target in (target for name in level for target in fed[name]):
            missing[target] -= 1
            if missing[target] == 0:
                ready.append(target)
    return order


def opened(ring: Sequence[str], sources: Sources, place: Mapping[str, int]) -> list[str]:
    """A ring in the order in which it is opened: its first, then the rest, part by part.

    What is left of a ring may be rings again, and so on inwards. They are found from the inmost
    outwards: components are added to a graph, the last first, and each of them becomes one with
    those that it closes a ring with. That takes time in proportion to the connections, except
    for rings that are made to be slow.
    """
    lead: dict[str, str] = {}
    feeding: dict[str, set[str]] = {}
    fed: dict[str, set[str]] = {}
    parts: dict[str, list[str]] = {}
    targets: dict[str, list[str]] = {name: [] for name in ring}
    for name in ring:
        for source in sources[name]:
            if source in targets:
                targets[source].append(name)

    def whole(name: str) -> str:
        while lead[name] != name:
            lead[name] = name = lead[lead[name]]
        return name

    for first in sorted(ring, key=place.__getitem__, reverse=True):
        feeding[first] = {whole(source) for source in sources[first] if source in lead}
        fed[first] = {whole(target) for target in targets[first] if target in lead}
        lead[first] = first
        inner = _closing(first, feeding, fed)
        waiting = {name: feeding[name] & inner for name in sorted(inner, key=place.__getitem__)}
        parts[first] = in_levels(waiting, ())
        for ends, others in ((feeding, fed), (fed, feeding)):
            ends[first] = ends[first].union(*(ends.pop(name) for name in inner)) - inner - {first}
            for name in ends[first]:
                others[name] = others[name] - inner | {first}
        lead |= dict.fromkeys(inner, first)
    order: list[str] = []
    ahead = [first]
    while ahead:
        order.append(ahead.pop())
        ahead += reversed(parts[order[-1]])
    return order


def _closing(first: str, feeding: Mapping[str, set[str]], fed: Mapping[str, set[str]]) -> set[str]:
    """What feeds a component, directly or through others, and is fed by it.

    The search goes both ways at the same time, until one of them has come to its end.
    """
    ways = (feeding, fed)
    found: tuple[set[str], set[str]] = (set(), set())
    ahead = [[first], [first]]
    while all(ahead):
        for neighbours, known, waiting in zip(ways, found, ahead, strict=True):
            new = neighbours[waiting.pop()] - known
            known |= new
            waiting += new
    done = 0 if not ahead[0] else 1
    within, neighbours = found[done], ways[1 - done]
    closing: set[str] = set()
    waiting = [first]
    while waiting:
        new = (neighbours[waiting.pop()] & within) - closing
        closing |= new
        waiting += new
    return closing - {first}


def strongly_connected(sources: Sources) -> list[list[str]]:
    """Components in parts of which each waits for all others of its part (Tarjan 1972).

    Returns:
        The parts; one comes after those that it waits for.

    """
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    open_: dict[str, None] = {}
    parts: list[list[str]] = []
    for root in sources:
        if root in number:
            continue
        path: list[tuple[str, Iterator[str]]] = []
        following: str | None = root
        while following is not None or path:
            if following is not None:
                number[following] = lowest[following] = len(number)
                open_[following] = None
                path.append((following, iter(sources[following])))
            name, ahead = path[-1]
            following = None
            for source in ahead:
                if source not in number:
                    following = source
                    break
                if source in open_:
                    lowest[name] = min(lowest[name], number[source])
            if following is not None:
                continue
            path.pop()
            if path:
                above = path[-1][0]
                lowest[above] = min(lowest[above], lowest[name])
            if lowest[name] == number[name]:
                part: list[str] = []
                while not part or part[-1] != name:
                    last, _ = open_.popitem()
                    part.append(last)
                parts.append(part)
    return parts
