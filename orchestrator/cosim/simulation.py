"""A run, from the first exchange of values to the last step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from copy import deepcopy
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.coupling import Coupling
from orchestrator.cosim.events import tune
from orchestrator.cosim.experiment import OURS, Exchange, Experiment
from orchestrator.cosim.fmi.instance import ComponentFailed, Ended, Instance, Log
from orchestrator.cosim.fmi.isolated import place_instances
from orchestrator.cosim.fmi.surroundings import Surroundings, default_mode
from orchestrator.cosim.hooks import NEVER, Hook, Run, stateful
from orchestrator.cosim.loop import PYTHON_LOOP, Stepping, choose_loop
from orchestrator.cosim.observers import Blocks, Ending, Header, NotKept, Observer
from orchestrator.cosim.plan import Plan
from orchestrator.cosim.row import Overrides, Row
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import Value, same
from orchestrator.machine.errors import InputError, StartError, reason, unforeseen
from orchestrator.machine.interrupts import Interrupts, held_interrupts
from orchestrator.machine.texts import literal

#: Most steps that take so short a time that no signal need be held back.
_FEW = 10


def simulate_plan(
    plan: Plan,
    observers: Sequence[Observer] = (),
    hooks: Sequence[Hook] = (),
    exchange: Exchange = OURS,
) -> Ending:
    """Run a system to its end.

    Args:
        plan: made by :func:`.plan.make_plan`.
        observers: take the rows.
        hooks: act between the steps, in this order.
        exchange: of values between components.

    Returns:
        How the run ended; after a failure the observers have the rows before it.

    Raises:
        InputError: an FMU or a parameter is not usable; nothing was stepped.
        KeyboardInterrupt: a signal arrived, and an FMU does not come to its first step.

    """
    session = Session(plan, observers, hooks, exchange)
    with session.calling(), session:
        session.advance()
        return session.end()


class SessionState(NamedTuple):
    """A state of a session, to which it or another one of the same system can go back.

    Attributes:
        experiment: grid of the steps.
        made: number of steps.
        n_rows: number of rows on this grid.
        row: values of the row.
        states: of the FMUs, by component.
        lasting: states of overrides, messages and hooks.
        dues: numbers of steps after which each hook acts.

    """

    experiment: Experiment
    made: int
    n_rows: int
    row: np.ndarray
    states: Mapping[str, bytes]
    lasting: Sequence[Any]
    dues: Sequence[int]


class _Calls:
    """Calls of FMUs from this process.

    Attributes:
        surroundings: to put back after a call; None: there is no call.
        interrupts: signals that have arrived in the last call.

    """

    def __init__(self) -> None:
        self.surroundings: Surroundings | None = None
        self.interrupts = Interrupts()

    def ours(self) -> AbstractContextManager[None]:
        """Return the context in which observers are called."""
        return nullcontext() if self.surroundings is None else self.surroundings.ours()

    def put_back(self) -> None:
        """Put back what FMUs have changed in this process."""
        if self.surroundings is not None:
            self.surroundings.put_back()


class Session:
    """A system whose FMUs are loaded, and stepped by calls of :meth:`advance`.

    It is a context manager: it loads the FMUs, exchanges initial values, and frees the FMUs.

    Attributes:
        plan: of the run.
        run: the run and its progress.
        header: of its rows.
        loop: name of the loop that makes the steps.
        failure: reason why no step follows, or None.
        remark: reason why the run has ended early without a failure, or None.

    """

    run: Run
    header: Header

    def __init__(
        self,
        plan: Plan,
        observers: Sequence[Observer] = (),
        hooks: Sequence[Hook] = (),
        exchange: Exchange = OURS,
    ) -> None:
        """Take the arguments of :func:`simulate_plan`; nothing is loaded yet."""
        self.plan = plan
        self.failure: str | None = None
        self.remark: str | None = None
        self._observers, self._hooks, self._exchange = observers, hooks, exchange
        self._stepping = choose_loop(plan.loop, plan.experiment, plan.isolation)
        self._log = Log()
        self._begun: list[Observer] = []
        self._instances: dict[str, Instance] = {}
        self._stack = ExitStack()
        self._steps: Iterator[None] | None = None
        self._present: np.ndarray | None = None
        # Apart from the session, which would else refer to itself, and keep its rows for longer.
        self._calls = _Calls()
        self._is_calm = plan.isolation is None and all(
            component.is_ours and not component.runs_python
            for component in plan.system.components.values()
        )

    @property
    def loop(self) -> str:
        """Name of the loop that makes the steps."""
        return self._stepping.name

    def calling(self, briefly: bool = False) -> AbstractContextManager[object]:
        """Return a context in which FMUs may be called; it may be nested.

        Signals to stop are held back, and whatever FMUs change in this process is restored at the
        end.

        Args:
            briefly: if set, FMUs of this program in C are called without it: they change nothing.

        """
        if self._calls.surroundings is not None or (briefly and self._is_calm):
            return nullcontext()
        return self._calling()

    @contextmanager
    def _calling(self) -> Iterator[None]:
        calls = self._calls
        # Overflowing values are reported as the value of a port, not by numpy.
        with (
            np.errstate(all="ignore"),
            default_mode(),
            held_interrupts() as calls.interrupts,
            Surroundings() as calls.surroundings,
        ):
            hand_over = calls.interrupts.hand_over
            self._watch_interrupts()
            try:
                yield
            finally:
                calls.put_back()
                calls.surroundings = None
                calls.interrupts.hand_over = hand_over

    def _watch_interrupts(self) -> None:
        if hasattr(self, "run"):
            self.run.interrupts = self._calls.interrupts
            self._calls.interrupts.hand_over = self.run.blocks.hand_over

    def __enter__(self) -> Session:
        """Open the session, unless it is open."""
        return self if self._instances else self.open()

    def open(self) -> Session:
        """Load the FMUs, and exchange initial values.

        Raises:
            InputError: an FMU or a parameter is not usable.

        """
        plan, calls = self.plan, self._calls
        for line in plan.remarks:
            self._log.remark(line)
        with self.calling(), ExitStack() as stack:
            with _explained():
                self._instances = stack.enter_context(
                    place_instances(
                        plan.system.components, self._log, plan.isolation, lambda: calls.interrupts
                    )
                )
                # Called first: a forked copy of this process must not end their processes.
                stack.callback(calls.put_back)
                self._stepping = _possible_stepping(self._stepping, self._instances, self._log)
            stack.push(self._tell_failure)
            self._begin()
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *failure: Any) -> None:
        """Free the FMUs."""
        with self.calling():
            self._stack.__exit__(*failure)

    def _begin(self) -> None:
        """Exchange initial values, and tell the observers."""
        plan, instances, log = self.plan, self._instances, self._log
        system = plan.system
        with _explained():
            slow = {name for name, n in plan.decimations.items() if n > 1}
            row = Row(system, instances, slow)
            coupling = Coupling(plan, instances, row, log, self._exchange)
            coupling.initialise()
            experiment = coupling.plan.experiment
            self.header = Header(
                tuple(map(str, row.columns)),
                experiment,
                _parameters(system, instances, log),
                self.loop,
                {str(port): standing.fmi_type for port, standing in row.standing.items()},
                system.units(row.columns),
                row.strings,
            )
        (stages, passing), gatherings = coupling.stages()
        with self._calls.ours():
            for observer in self._observers:
                observer.begin(self.header)
                self._begun.append(observer)
        blocks = Blocks(len(row.shown), self._observers, self._calls.ours, row.arrange)
        if passing is None:
            blocks.append(experiment.start_time, row.shown)
        overrides = Overrides(row, gatherings, system.connections)
        self.run = Run(
            system, experiment, instances, row, stages, passing,
            overrides, blocks, log, self._calls.interrupts, self._hooks,
        )  # fmt: skip
        self._order = [name for names in coupling.plan.arrangement.stages for name in names]
        self._steps = self._present = None
        self._watch_interrupts()

    def advance(self, until: int | None = None) -> None:
        """Make steps, up to some number of them on the present grid, or to the end of the run.

        After a failure, or the end of the run, nothing happens.
        """
        if self.failure is not None or self.remark is not None:
            return
        run = self.run
        run.until = NEVER if until is None else until
        self._present = None
        with self.calling(briefly=run.until - run.made <= _FEW):
            try:
                self.failure = self._advance(until is None)
            except NotKept as error:
                # A run whose rows cannot be kept stops.
                self.failure = str(error)
            except Ended as end:
                self.remark = str(end)

    def _advance(self, to_end: bool) -> str | None:
        """Step until enough steps are made or to the first failure, and return the failure."""
        run = self.run
        blocks, failure = run.blocks, None
        try:
            if self._step_on():
                return None
            if run.interrupts.numbers:
                failure = f"interrupted at t = {run.time:.12g} s{run.interrupts}"
            if to_end:
                run.show()
        except ComponentFailed as error:
            failure = f"stopped at t = {run.time:.12g} s: {error}"
        except KeyboardInterrupt:
            failure = f"interrupted at t = {run.time:.12g} s{run.interrupts}"
            if self._calls.surroundings is None:
                # Perhaps within a step: no other may follow.
                self.failure = failure
                raise
        except Ended as end:
            with suppress(ComponentFailed):
                run.show()
            blocks.hand_over()
            raise Ended(f"ended at t = {run.time:.12g} s: {end}") from None
        except (InputError, NotKept):
            raise
        except Exception as error:
            failure = f"stopped at t = {run.time:.12g} s: {unforeseen(error)}"
        self._calls.put_back()
        # Checked even if another component has refused the value in the same step.
        if wrong := run.row.wrong(self._order, run.passing is not None):
            failure = f"stopped at t = {run.experiment.time(blocks.count):.12g} s: {wrong}"
        blocks.hand_over()
        return failure

    # Between the steps

    @property
    def made(self) -> int:
        """Number of steps on the present grid."""
        return self.run.made

    @property
    def experiment(self) -> Experiment:
        """Present grid of the steps."""
        return self.run.experiment

    def regrid(self, experiment: Experiment) -> None:
        """Continue with the steps of an experiment that begins now, or when the present one did."""
        run = self.run
        if experiment.start_time != run.experiment.start_time:
            run.blocks.restart(run.blocks.count - run.made)
            run.made = 0
        run.experiment = experiment
        self._steps = None

    def take_interrupts(self) -> Sequence[int]:
        """Return the signals that have stopped the last steps; more steps may then follow."""
        numbers = self._calls.interrupts.numbers
        if numbers:
            self._calls.interrupts = self.run.interrupts = Interrupts()
            self.failure = None
        return numbers

    def values(self) -> np.ndarray:
        """Return the present values of all columns, as the next row will show them.

        A failure shows in :attr:`failure`.
        """
        if self._present is None:
            run = self.run
            self._present = run.row.shown.copy()
            try:
                with self.calling(briefly=True), run.ahead():
                    self._present = run.row.shown.copy()
            except ComponentFailed as error:
                self.failure = self.failure or f"stopped at t = {run.time:.12g} s: {error}"
            run.row.arrange(self._present)
        return self._present

    def override(self, target: PortName, value: Value) -> None:
        """Give an input a value, whatever feeds it."""
        self._present = None
        self.run.overrides.override(target, value)

    def release(self, target: PortName) -> None:
        """Let an input take again what feeds it, or the value that it had before."""
        self._present = None
        self.run.overrides.release(target)

    def tune(self, target: PortName, value: Value) -> None:
        """Set a tunable parameter.

        Raises:
            InputError: the FMU refuses the value.

        """
        self._present = None
        with self.calling(briefly=True), _explained():
            tune(self.run, target, value)

    def parameter(self, name: PortName) -> Value:
        """Return the value of a parameter, as its FMU holds it."""
        with self.calling(briefly=True):
            return self._instances[name.component].read([name.port])[name.port]

    def save(self) -> SessionState:
        """Return the present state.

        Raises:
            InputError: an FMU does not provide its state.

        """
        run = self.run
        with self.calling(briefly=True), _explained():
            states = {name: instance.state() for name, instance in self._instances.items()}
        return SessionState(
            run.experiment,
            run.made,
            run.blocks.count,
            run.row.values.copy(),
            states,
            deepcopy([part.state() for part in stateful(run)]),
            (*run.dues,),
        )

    def restore(self, state: SessionState) -> None:
        """Go back to a state, of this session or of another one of the same system.

        Raises:
            InputError: an FMU refuses it.

        """
        run = self.run
        with self.calling(briefly=True), _explained():
            for name, instance in self._instances.items():
                instance.restore(state.states[name])
        for part, of_part in zip(stateful(run), deepcopy(state.lasting), strict=True):
            part.restore(of_part)
        run.row.values[:] = state.row
        run.experiment, run.made, run.dues = state.experiment, state.made, [*state.dues]
        run.due = min(run.dues, default=NEVER)
        run.blocks.restart(state.n_rows)
        self.failure = self.remark = self._steps = self._present = None

    def reset(self, plan: Plan, hooks: Sequence[Hook] = ()) -> None:
        """Begin again, with other parameters of the same system; observers begin again, too.

        Raises:
            InputError: a parameter is not usable.

        """
        self.plan, self._hooks = plan, hooks
        self.failure = self.remark = None
        self._begun.clear()
        self._log.restore(Log().state())
        with self.calling():
            with _explained():
                for instance in self._instances.values():
                    instance.reset()
            self._begin()

    def _step_on(self) -> bool:
        """Make steps until they are enough, and return True; False: no step follows."""
        run = self.run
        steps = self._steps or self._stepping.steps(run)
        self._steps = None
        if run.made >= run.due:
            run.call_hooks()
        if run.made >= run.until:
            return True
        for _ in steps:
            if run.made >= run.due:
                run.call_hooks()
            if monotonic() > run.blocks.due:
                run.blocks.hand_over()
            if run.interrupts.numbers:
                return False
            if run.made >= run.until:
                self._steps = steps
                return True
        return False

    def hand_over(self) -> None:
        """Give the observers all rows so far."""
        self.run.blocks.hand_over()

    @property
    def is_shown(self) -> bool:
        """True if the row of the present time was kept."""
        return self.run.blocks.count > self.run.made

    @property
    def ending(self) -> Ending:
        """The ending of the run, if it ends now."""
        return Ending(
            self.failure,
            self.remark,
            self._log.messages,
            tuple(self._calls.interrupts.numbers),
            tuple(self.run.happened),
        )

    def end(self) -> Ending:
        """Terminate the FMUs, unless one has failed, and tell the observers how the run ended."""
        with self.calling():
            if self.failure is None:
                for instance in self._instances.values():
                    # The rows are complete even if the FMU fails to terminate.
                    with suppress(ComponentFailed):
                        instance.terminate()
            ending = self.ending
            self._tell(ending)
        return ending

    def _tell(self, ending: Ending) -> None:
        """End the observers; all of them are ended, even if one fails."""
        self._calls.put_back()
        while self._begun:
            self._begun.pop(0).end(ending)

    def _tell_failure(self, _: object, error: BaseException | None, __: object) -> None:
        if error is not None:
            with suppress(Exception):
                self._tell(Ending(f"stopped: {reason(error)}"))


def _possible_stepping(stepping: Stepping, instances: Mapping[str, Instance], log: Log) -> Stepping:
    """Return the stepping, or the Python loop where an FMU runs in another process."""
    apart = [name for name, instance in instances.items() if not instance.is_here]
    if not apart or stepping == PYTHON_LOOP:
        return stepping
    log.remark(
        f"{', '.join(apart)}: runs in a separate process, since the FMU allows one instance "
        "per process; the Python loop takes the steps"
    )
    return PYTHON_LOOP


def _parameters(
    system: System, instances: Mapping[str, Instance], log: Log
) -> dict[PortName, object]:
    """Return the values of all parameters as the FMUs hold them, and log those that were not kept.

    Some FMUs overwrite values silently.
    """
    parameters: dict[PortName, object] = {}
    for name, instance in instances.items():
        component, values = system.components[name], system.parameters_of(name)
        own = [variable.name for variable in component.having("parameter")]
        lasting = [port for port in values if component.variables[port].initial == "exact"]
        held = instance.read(list(dict.fromkeys((*own, *lasting))))
        for port in lasting:
            if not same(values[port], held[port]):
                log.remark(
                    f"{name}.{port} was set to {literal(values[port])}, but the FMU holds "
                    f"{literal(held[port])}"
                )
        parameters |= {
            PortName(name, port): component.variables[port].shown(held[port]) for port in own
        }
    return parameters


@contextmanager
def _explained() -> Iterator[None]:
    """Raise an InputError for a component that fails outside a step."""
    try:
        yield
    except ComponentFailed as error:
        raise (StartError if error.fatal else InputError)(str(error)) from error
