"""The user's own indices, in files next to a study."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from orchestrator import simulate, sweep
from orchestrator.figures.study_values import Values
from orchestrator.machine.errors import InputError, Refused
from orchestrator.studies.columns import Point
from orchestrator.studies.engine import outcomes_of
from orchestrator.studies.own_indices import OwnIndex, read_own_index, with_fields
from orchestrator.studies.study import read_study
from orchestrator.studies.sweep import Means, prepare_study

#: The last time at which the depth is further than this from its reference [m].
NEAR = 0.5

SETTLING = f"""\
\"\"\"When the depth has come to stay near its reference.\"\"\"

from __future__ import annotations

from math import nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Inputs(NamedTuple):
    z: Annotated[float, Variable("m", "Depth", name="plant.eta.z")]
    z_d: Annotated[float, Variable("m", "Reference", name="planner.y_d.z")]


class State(NamedTuple):
    away: float


class Outputs(NamedTuple):
    settling: Annotated[float, Variable("s", "last time that z is away")]


def start(inputs: Inputs, t: float) -> State:
    return update(State(nan), inputs, t)


def update(state: State, inputs: Inputs, t: float) -> State:
    return State(t) if abs(inputs.z - inputs.z_d) > {NEAR} else state


def outputs(state: State) -> Outputs:
    return Outputs(state.away)
"""

STUDY = """\
scenario = "{scenario}"
stop_time = {stop_time}

[vary]
{varies} = {values}

[figures.settle]
kind = "bands"
x = "{varies}"
show = {show}
"""


def study(
    folder: Path, text: str = SETTLING, name: str = "settling", **changes: object
) -> tuple[Path, Path]:
    """A study, and the file of an index beside it."""
    settings = {
        "scenario": "fig4", "stop_time": 10.0, "varies": "plant.eta0.z", "values": [-2.0, 3.0],
        "show": f'"{name}"',
    } | changes  # fmt: skip
    file, index = folder / "mine.toml", folder / f"{name}.py"
    file.write_text(STUDY.format(**settings))
    index.write_text(text)
    return file, index


def test_an_index_beside_a_study_is_a_column_of_its_runs(tmp_path):
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    file, _ = study(tmp_path, values=[-5.0, -2.0, 3.0])
    result = sweep(file, kind="native", out=tmp_path / "out")
    times = []
    for z, found in zip(result["plant.eta0.z"], result["settling"], strict=True):
        run = simulate("fig4", {"plant.eta0.z": z}, stop_time=10.0, kind="native")
        away = np.abs(run["plant.eta.z"] - run["planner.y_d.z"]) > NEAR
        times.append(run.time[away].max(initial=-1.0))
        # Without an event there is no time.
        assert np.nan_to_num(found, nan=-1.0) == times[-1]
    assert min(times) == -1.0 and max(times) > 1.0
    assert (tmp_path / "out" / "settle.png").is_file()
    # Another text gives other numbers.
    study(tmp_path, SETTLING.replace("0.5", "0.25"), values=[-5.0, -2.0, 3.0])
    with pytest.raises(InputError, match="holds another study, which differs in indices"):
        sweep(file, kind="native", out=tmp_path / "out")


def test_a_file_may_hold_several(tmp_path):
    text = SETTLING.replace(
        "class Outputs(NamedTuple):",
        "class Outputs(NamedTuple):\n"
        '    away: Annotated[tuple[float, float], Variable({"a": "s", "b": "s"}, "A pair")]',
    ).replace("Outputs(state.away)", "Outputs((state.away, 1.0), state.away)")
    file, _ = study(tmp_path, text, "both")
    ready = prepare_study(read_study(str(file)), Means(kind="native"))
    assert ready.space.indices[-3:] == ("away.a", "away.b", "settling")
    assert ready.figures[0].show == ["away", "settling"]
    assert Values({}, units=ready.space.units).label("away") == "away [s]"
    [outcome] = outcomes_of(ready.engine, [Point(0, "fig4", {}, 0.1, 0.02)])
    assert outcome.indices["away.b"] == 1.0


def test_it_is_pickled_with_the_engine(tmp_path):
    file, index = study(tmp_path)
    engine = prepare_study(read_study(str(file)), Means(kind="native")).engine
    runs = [Point(0, "fig4", {"plant.eta0.z": 3.0}, 1.0, 0.02)]
    [here] = outcomes_of(engine, runs)
    sent = pickle.dumps(engine)
    index.unlink()
    assert list(outcomes_of(pickle.loads(sent), runs)) == [here]
    assert here.indices["settling"] == 1.0


def test_each_vehicle_has_its_index(tmp_path):
    file, _ = study(
        tmp_path, scenario="formation-v", varies="auv1.plant.m11", values=[200.0], stop_time=1.0
    )
    ready = prepare_study(read_study(str(file)), Means(kind="native"))
    assert ready.figures[0].show == [f"auv{i}.settling" for i in (1, 2, 3)]
    [outcome] = outcomes_of(ready.engine, [ready.space[0]])
    assert outcome.failure is None
    assert {name for name in outcome.indices if "settling" in name} <= {*ready.figures[0].show}


def test_an_exception_of_an_index_is_the_failure_of_a_run(tmp_path):
    file, _ = study(tmp_path, SETTLING.replace("return State(t)", "return State(1.0 / (t - t))"))
    engine = prepare_study(read_study(str(file)), Means(kind="native")).engine
    [outcome] = outcomes_of(engine, [Point(0, "fig4", {"plant.eta0.z": 3.0}, 1.0, 0.02)])
    assert outcome.indices == {}
    why = "index settling: at t = 0 s: ZeroDivisionError: float division by zero"
    assert outcome.failure == why


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("plant.eta.z", "plant.etta.z", "settling.py: fig4 has no plant.etta.z; did you mean pl"),
        ('"m", "Depth", name="plant.eta.z"', '"1", "Roll", name="plant.roll"', "type Boolean, n"),
        ("    settling:", "    late_error:", "settling.py: auv-fmu has an index late_error; rena"),
        ("return State(t)", "return State(t ** 0.5)", "settling.py:29: ** with other than a whol"),
        ("def start", "def begin", "has no function start; an index has start, update, outputs"),
        ("inputs: Inputs, t: float) -> State:\n    return State(t)",
         "inputs: Inputs, time: float) -> State:\n    return State(time)", "takes time, which is "),
        ("from math import nan", "from math import nan\nimport beside", "No module named 'beside'"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_before_the_first_run(tmp_path, before, after, words):
    assert before in SETTLING
    file, _ = study(tmp_path, SETTLING.replace(before, after))
    with pytest.raises(Refused) as raised:
        prepare_study(read_study(str(file)), Means(kind="native"))
    assert words in str(raised.value)


def test_an_index_is_one_file(tmp_path):
    (tmp_path / "beside.py").write_text("LIMIT = 0.5\n")
    _, index = study(
        tmp_path, SETTLING.replace("import nan", "import nan\nfrom beside import LIMIT")
    )
    with pytest.raises(InputError, match="No module named 'beside'; an index is one file"):
        read_own_index(index)


def test_a_name_without_a_file_is_refused(tmp_path):
    file, index = study(tmp_path)
    index.unlink()
    with pytest.raises(Refused, match=r"no number 'settling', and there is no settling\.py"):
        prepare_study(read_study(str(file)), Means(kind="native"))


def test_figures_without_own_indices_are_not_changed():
    own = OwnIndex("other", SETTLING.encode())
    figures = {"f": {"kind": "front", "x": "a", "y": "b"}, "labels": {"a": "A"}}
    assert with_fields(figures, [own], ["settling"]) == figures
