"""Values handed along all connections at one time, until every input has what feeds it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from orchestrator.errors import shortened
from orchestrator.master.instance import ComponentFailed, Instance
from orchestrator.master.ring import Ring
from orchestrator.master.row import Row
from orchestrator.master.signals import Gathering
from orchestrator.system.names import PortName
from orchestrator.system.structure import System

#: Values go along all connections so often, until they rest.
_MOST_ROUNDS = 1000


class Settling:
    """Hands values along the order in which components feed each other directly."""

    def __init__(
        self,
        system: System,
        instances: Mapping[str, Instance],
        row: Row,
        plan: Sequence[Sequence[str]],
        rings: Iterable[Ring] = (),
    ) -> None:
        """Tie it to the row of all values.

        Args:
            system: whose connections say what feeds what.
            instances: of its components.
            row: that they are tied to.
            plan: its components in the order of their feedthroughs.
            rings: of them that are solved, each a stage of the plan.

        """
        self._system, self._instances, self._row = system, instances, row
        ring_of = {ring.names[0]: ring for ring in rings}
        inner = {name: ring for ring in ring_of.values() for name in ring.names}
        self._units: list[tuple[Gathering, Instance | Ring]] = []
        for stage in plan:
            ring = ring_of.get(stage[0])
            for names in [stage] if ring else [[name] for name in stage]:
                connections = [
                    connection
                    for name in names
                    for connection in system.feeding[name]
                    if not ring or inner.get(connection.source.component) is not ring
                ]
                self._units.append((Gathering.along(row, connections), ring or instances[names[0]]))

    @property
    def gatherings(self) -> list[Gathering]:
        """All that it gathers."""
        inner = [one.gatherings for _, one in self._units if isinstance(one, Ring)]
        return [gather for gather, _ in self._units] + [one for some in inner for one in some]

    def begin(self) -> None:
        """Settle for the first time, when no output has been read.

        Raises:
            ComponentFailed: values do not come to rest, or a component fails.

        """
        self._read_ahead()
        self.hand_on(everything=True)
        self.settle()

    def settle(self) -> None:
        """Hand values on until every input has what feeds it.

        Raises:
            ComponentFailed: values do not come to rest, or a component fails.

        """
        for _ in range(_MOST_ROUNDS):
            before = self._row.values.copy()
            if not self.hand_on():
                return
        if restless := self._row.moving(before):
            raise ComponentFailed(
                f"values do not come to rest: {shortened(', '.join(map(str, restless)))} in an "
                "algebraic loop"
            )

    def hand_on(self, everything: bool = False) -> bool:
        """Hand values along all connections once.

        Args:
            everything: also to components whose inputs are what they were.

        Returns:
            Whether any input has changed.

        """
        values, changed = self._row.values, False
        for gather, one in self._units:
            before = values[gather.targets]
            gather(values)
            as_before = np.array_equal(before, values[gather.targets], equal_nan=True)
            if isinstance(one, Ring):
                if everything or not as_before or not one.is_closed:
                    one.close()
                    changed = True
            elif everything or not as_before:
                one.exchange()
                self._row.show(one.name)
                changed = True
        return changed

    def _read_ahead(self) -> None:
        """Read outputs that feed a component before it is their own component's turn."""
        row, instances = self._row, self._instances
        place: dict[str, int] = {}
        for i, (_, one) in enumerate(self._units):
            place |= dict.fromkeys(one.names if isinstance(one, Ring) else [one.name], i)
        wanted: dict[str, dict[str, None]] = {}
        for connection in self._system.connections:
            source, target = connection.source, connection.target
            if place[source.component] >= place[target.component]:
                wanted.setdefault(source.component, {})[source.port] = None
        for name, ports in wanted.items():
            held = instances[name].read(list(ports))
            row.enter({PortName(name, port): value for port, value in held.items()})
