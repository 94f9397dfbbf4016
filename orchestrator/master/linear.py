"""Steps in which inputs change linearly from one communication point to the next.

Every step is made twice. The first time all inputs are held, which says what they come to at its
end; then the components go back to its beginning, and make it with inputs that change to these
values. The error of what is coupled falls with the square of the step, where held inputs give its
first power.
"""

from __future__ import annotations

from collections.abc import Mapping

from orchestrator.master.fmi.instance import Instance
from orchestrator.master.row import Row
from orchestrator.master.schedule import member, step
from orchestrator.master.settling import Settling
from orchestrator.system.names import PortName
from orchestrator.system.structure import System


class LinearSteps:
    """Makes the steps of a whole system."""

    def __init__(
        self, system: System, instances: Mapping[str, Instance], row: Row, settling: Settling
    ) -> None:
        """Tie it to the row of all values.

        Args:
            system: that is stepped.
            instances: of its components.
            row: that they are tied to.
            settling: hands values on at one time.

        """
        self._values, self._settling = row.values, settling
        self._fed = {name: one for name, one in instances.items() if system.feeding[name]}
        self._all, self._again = (
            [member(instance) for instance in some.values()] for some in (instances, self._fed)
        )
        self._inputs = [
            row.columns[PortName(name, variable.name)]
            for name in self._fed
            for variable in system.components[name].having("input")
        ]
        self._changing: dict[str, tuple[list[int], list[int]]] = {}
        for name in self._fed:
            component = system.components[name]
            targets = [
                connection.target
                for connection in system.feeding[name]
                if component.is_continuous(connection.target.port)
            ]
            self._changing[name] = (
                [component.variables[target.port].valueReference for target in targets],
                [row.columns[target] for target in targets],
            )

    def step(self, t: float, h: float) -> None:
        """Make a step.

        Raises:
            ComponentFailed: a component fails, or values do not come to rest.

        """
        values, instances = self._values, self._fed.values()
        self._settling.settle()
        begin = values.copy()
        for instance in instances:
            instance.keep()
        step(self._all, t, h, is_final=False)
        self._settling.settle()
        slopes = (values - begin) / h
        values[self._inputs] = begin[self._inputs]
        for instance in instances:
            instance.go_back()
            references, columns = self._changing[instance.name]
            instance.let_change(references, slopes[columns].tolist())
        step(self._again, t, h)
        for instance in instances:
            references, _ = self._changing[instance.name]
            instance.let_change(references, [0.0] * len(references))
        self._settling.settle()
