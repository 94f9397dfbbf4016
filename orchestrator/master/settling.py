"""Values handed along all connections at one time, until every input has what feeds it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from orchestrator.machine.errors import shortened
from orchestrator.master.fmi.instance import ComponentFailed, Instance
from orchestrator.master.gathering import Gathering
from orchestrator.master.ring import Ring
from orchestrator.master.row import Row
from orchestrator.system.names import PortName
from orchestrator.system.structure import System

#: Values go along all connections so often, until they rest.
_MOST_ROUNDS = 1000


class _Single:
    """A component of no ring: see :class:`.ring.Ring`."""

    def __init__(self, name: str, system: System, instance: Instance, row: Row) -> None:
        self.names = [name]
        self._instance, self._row = instance, row
        self._gather = Gathering.along(row, system.feeding[name])
        self.gatherings = [self._gather]

    def renew(self, always: bool = False) -> bool:
        values, targets = self._row.values, self._gather.targets
        before = values[targets]
        self._gather(values)
        if not always and before.tobytes() == values[targets].tobytes():
            return False
        self._instance.exchange()
        self._row.show(self._instance.name)
        return True


class Settling:
    """Hands values along the order in which components feed each other directly."""

    def __init__(
        self,
        system: System,
        instances: Mapping[str, Instance],
        row: Row,
        sequence: Sequence[Sequence[str]],
        rings: Iterable[Ring] = (),
    ) -> None:
        """Tie it to the row of all values.

        Args:
            system: whose connections say what feeds what.
            instances: of its components.
            row: that they are tied to.
            sequence: its components in the order of their feedthroughs.
            rings: of them that are solved, in stages of their own.

        """
        self._system, self._instances, self._row = system, instances, row
        ring_of = {ring.names[0]: ring for ring in rings}
        self._units: list[Ring | _Single] = []
        for stage in sequence:
            ringed = [ring_of[name] for name in stage if name in ring_of]
            self._units += ringed or [_Single(one, system, instances[one], row) for one in stage]

    @property
    def gatherings(self) -> list[Gathering]:
        """All that it gathers."""
        return [gather for unit in self._units for gather in unit.gatherings]

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
        changed = [unit.renew(everything) for unit in self._units]
        return any(changed)

    def _read_ahead(self) -> None:
        """Read outputs that feed a component before it is their own component's turn."""
        row, instances = self._row, self._instances
        place: dict[str, int] = {}
        for i, unit in enumerate(self._units):
            place |= dict.fromkeys(unit.names, i)
        wanted: dict[str, dict[str, None]] = {}
        for connection in self._system.connections:
            source, target = connection.source, connection.target
            if place[source.component] >= place[target.component]:
                wanted.setdefault(source.component, {})[source.port] = None
        for name, ports in wanted.items():
            held = instances[name].read(list(ports))
            row.enter({PortName(name, port): value for port, value in held.items()})
