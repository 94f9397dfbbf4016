"""Whatever hooks take, a run is as if everything was computed each time that it is needed."""

from __future__ import annotations

import json
from inspect import signature
from math import ceil
from random import Random
from types import ModuleType, SimpleNamespace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import Refusal
from fmus.python.slave import slave_of
from support.variants_of_hooks import Hooks, component

#: References of the ports.
U, Y, Z, P = 0, 1, 2, 3


def ask(module: ModuleType, hook: str, known: dict[str, Any]) -> Any:
    """Call a hook with the arguments that it takes."""
    function = getattr(module, hook)
    return function(**{name: known[name] for name in signature(function).parameters})


class Plain:
    """The same run, from the documentation of the hooks: no value is kept."""

    def __init__(self, module: ModuleType, hooks: Hooks, start: float) -> None:
        self.module, self.hooks, self.start = module, hooks, start
        self.u, self.p, self.t, self.fault = 0.5, 1.0, start, False
        self.parameters = module.Parameters()
        self.random = Random(5)
        self.n = self.random.gauss(0.0, 1.0)
        self.x = ask(module, "start", self.known(None, start))
        self.shown = self.evaluated(self.x, self.n, start)
        #: True if the output is the shown one, and if it belongs to the present state.
        self.is_held = self.is_of_now = True

    def known(self, state: Any, t: float, **more: Any) -> dict[str, Any]:
        parameters = self.module.Parameters(self.p)
        inputs = self.module.Inputs(self.u)
        return {"parameters": parameters, "inputs": inputs, "state": state, "t": t, **more}

    def guarded(self, state: Any) -> Any:
        if self.hooks.has_guard and not ask(self.module, "credible", self.known(state, 0.0)):
            return ask(self.module, "restarted", self.known(state, 0.0))
        return state

    def asked(self, hook: str, state: Any, t: float, h: float = 0.0) -> Any:
        known = self.known(state, t, h=h)
        if self.hooks.derive:
            known["derived"] = ask(self.module, "derive", known)
        return ask(self.module, hook, known)

    def evaluated(self, state: Any, n: float, t: float) -> float:
        y: float = self.asked("outputs", self.guarded(state), t).y
        return y + 0.1 * self.p * n if self.hooks.has_noise else y

    def depends(self, on: str) -> bool:
        """True if outputs depend on something, as their arguments show."""
        taken = {*self.hooks.outputs}
        if "derived" in taken:
            taken |= {*(self.hooks.derive or ())}
        if "state" in taken and self.hooks.has_guard:
            taken.add("inputs")
        return on in taken or (on == "parameters" and self.hooks.has_noise)

    def put(self, name: str, value: float) -> None:
        setattr(self, name, value)
        self.is_held &= not self.depends({"u": "inputs", "p": "parameters"}[name])

    def get(self) -> float | None:
        """The output; None: it is refused."""
        if not (self.hooks.is_sampled and self.is_held):
            try:
                self.shown = self.evaluated(self.x, self.n, self.t)
            except Refusal:
                # Outputs that nothing has changed were good before.
                assert not self.is_held
                self.fault = True
                return None
            self.is_held = self.is_of_now = True
        return self.shown

    def step(self, t: float, h: float) -> bool:
        count = ceil(h / (0.05 * (1.0 + 1e-9))) if self.hooks.is_split else 1
        shown, before = self.shown, self.random.getstate()
        is_there = self.is_held and self.is_of_now and (t == self.t or not self.depends("t"))
        try:
            if self.hooks.is_sampled and not is_there:
                shown = self.evaluated(self.x, self.n, t)
            state = self.guarded(self.x)
            for i in range(count):
                state = self.asked("update", state, t + i * (h / count), h / count)
            k = round((t - self.start) / h)
            end = self.start + (k + 1) * h if t == self.start + k * h else t + h
            n = self.random.gauss(0.0, 1.0)
            if not self.hooks.is_sampled and not self.depends("inputs"):
                shown = self.evaluated(state, n, end)
        except Refusal:
            self.random.setstate(before)
            self.fault = True
            return False
        self.x, self.n, self.t, self.shown = state, n, end, shown
        self.is_held = self.hooks.is_sampled or not self.depends("inputs")
        self.is_of_now = not self.hooks.is_sampled
        return True


ARGUMENTS = ("parameters", "state", "inputs", "t")


@st.composite
def hooks(draw: st.DrawFn) -> Hooks:
    some = st.lists(st.sampled_from(ARGUMENTS), min_size=1, unique=True).map(tuple)
    derive = draw(st.none() | some)
    outputs = draw(some)
    if derive and draw(st.booleans()):
        outputs = (*outputs, "derived")
    drawn = Hooks(outputs, derive, False, *(draw(st.booleans()) for _ in range(3)))
    follows = Plain.depends(SimpleNamespace(hooks=drawn), "inputs")
    return drawn._replace(is_sampled=follows and draw(st.booleans()))


NUMBERS = st.floats(-4.0, 4.0) | st.sampled_from([0.0, 8.0, 40.0])
ACTIONS = st.lists(
    st.one_of(
        st.tuples(st.just("u"), NUMBERS),
        st.tuples(st.just("p"), st.floats(-4.0, 4.0)),
        st.tuples(st.just("restore"), st.booleans()),
        st.tuples(st.sampled_from(["step", "get"]), st.just(0.1)),
        st.tuples(st.sampled_from(["step", "jump"]), st.sampled_from([0.0, 0.02, 0.3])),
    ),
    min_size=20,
    max_size=40,
)


@given(hooks(), st.sampled_from([0.0, 1.3]), ACTIONS)
def test_nothing_that_is_kept_is_ever_seen(hooks, start, actions):
    module = component(hooks)
    made = slave_of("Variant", module)

    def instance() -> Any:
        slave = made(instance_name="one")
        slave._has_loader = True
        slave.setup_experiment(start)
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
        return slave

    slave, plain = instance(), Plain(module, hooks, start)
    for action, value in actions:
        if action in "up":
            slave.set_real([{"u": U, "p": P}[action]], [value])
            plain.put(action, value)
        elif action == "restore":
            saved = slave._get_fmu_state()
            slave = instance()
            slave._set_fmu_state(json.loads(json.dumps(saved)) if value else saved)
            plain.is_held &= hooks.is_sampled
        elif action == "get":
            expected, [found] = plain.get(), slave.get_real([Y])
            assert found == expected or expected is None
            assert slave.get_integer([Z]) in ([7], [0])
        elif value > 0.0:
            t = plain.t + (action == "jump")
            assert slave.do_step(t, value) is plain.step(t, value)
        else:
            assert slave.do_step(plain.t, 0.0)
        assert slave.get_boolean([len(made.ports)]) == [plain.fault]
    assert slave._get_fmu_state()["state"] == plain.x
