"""Tracks: their tables, their splines, and their planners in both kinds."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from auv_fmu.guidance.follower import Follower
from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.errors import InputError
from orchestrator.program.components import refusals
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.tracks import planner_text, read_track, velocities
from support.language import module_of
from support.texts import mentions

#: Rows that are far apart and close together.
TIMES = np.cumsum(np.random.default_rng(1).uniform(0.1, 5.0, 300))
STOP = TIMES[-20]

HEADER = "time,x,y,z\n"
ROWS = "0,0,0,1\n10,4,0,1\n20,8,1,1\n30,12,2,1\n"


def course(t: np.ndarray) -> np.ndarray:
    """A course at 0.3 to 0.4 m/s, which comes to rest within the last rows."""
    s = np.minimum(t, STOP) - STOP
    s = 0.3 * s + 3.0 * (1.0 - np.exp(np.minimum(s / 10.0, 0.0)))
    return np.column_stack([s, 8.0 * np.sin(0.08 * s), 5.0 + np.cos(0.03 * s)])


def planner(folder: Path, t: np.ndarray, y: np.ndarray, name: str) -> ModuleType:
    return module_of(planner_text("Follow", np.column_stack([t, y]), "a.csv"), folder, name)


@given(st.integers(0, 2**32 - 1), st.integers(4, 40))
def test_velocities_equal_scipys(seed, n):
    random = np.random.default_rng(seed)
    t, y = np.cumsum(random.uniform(0.05, 5.0, n)), random.uniform(-10.0, 10.0, (n, 3))
    expected = CubicSpline(t, y)(t, 1)
    np.testing.assert_allclose(velocities(t, y), expected, atol=1e-12 * np.abs(expected).max())


def test_planner_is_the_spline_of_scipy_between_all_rows(tmp_path: Path):
    module = planner(tmp_path, TIMES, course(TIMES), "between_rows")
    spline = CubicSpline(TIMES, course(TIMES))
    for t in np.random.default_rng(2).uniform(TIMES[0], TIMES[-1], 500).tolist():
        reference = module.outputs(Follower(), t).reference
        for order, values in enumerate(reference):
            np.testing.assert_allclose(values, spline(t, order), rtol=1e-12, atol=1e-12)


def test_posture_points_along_the_track_and_at_rest_as_before(tmp_path: Path):
    """Before the track, as at its start; the control point is ell ahead of the centre of mass."""
    module = planner(tmp_path, TIMES, course(TIMES), "with_a_rest")
    begin = CubicSpline(TIMES, course(TIMES))(TIMES[0], 1)
    for t, (x, y, z) in ((0.0, begin), (STOP, (1.0, 0.64, 0.0)), (2000.0, (1.0, 0.64, 0.0))):
        outputs = module.outputs(Follower(), t)
        *place, theta, psi = outputs.eta_d
        assert psi == pytest.approx(np.arctan2(y, x), abs=0.02)
        assert theta == pytest.approx(np.arctan2(-z, np.hypot(x, y)), abs=0.02)
        ahead = np.array([np.cos(theta) * np.cos(psi), np.cos(theta) * np.sin(psi), -np.sin(theta)])
        np.testing.assert_allclose(outputs.reference.y_d, place + 0.35 * ahead, atol=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        HEADER + ROWS,
        "T;y_d.x;Y;z\n" + ROWS.replace(",", ";"),
        "z,speed,y,x,t\n" + "".join(
            f"{z},fast,{y},{x},{t}\n" for t, x, y, z in (row.split(",") for row in ROWS.split())
        ),
    ],
)  # fmt: skip
def test_columns_are_found_by_their_names(tmp_path: Path, text: str):
    file = tmp_path / "a.csv"
    file.write_text(text)
    assert read_track(file).tolist() == [
        [0.0, 0.0, 0.0, 1.0], [10.0, 4.0, 0.0, 1.0], [20.0, 8.0, 1.0, 1.0], [30.0, 12.0, 2.0, 1.0],
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "culprits"),
    [
        (None, "no such file"),
        ("", "x"),
        ("time,x,y\n0,0,0\n", "lacks column z"),
        ("s,x,y,z\n0,0,0,0\n", "lacks column time"),
        ("time,x,y,z,y_d.x\n0,0,0,0,0\n", "two columns x"),
        (HEADER + ROWS.replace("20,8", "20,nan"), "line 4 x 'nan' finite"),
        (HEADER + ROWS.replace("20,8", "20,"), "line 4 x '' number"),
        (HEADER + ROWS.replace("20,8", "inf,8"), "line 4 time 'inf' finite"),
        (HEADER + ROWS.replace("20,8", "10,8"), "line 4 10 s 10 s increase"),
        (HEADER + ROWS + "40,1\n", "line 6 2 values 4"),
        (HEADER + ROWS.replace("30,12,2,1\n", ""), "3 rows 4 [path]"),
        (HEADER + "".join(f"{t},0,0,0\n" for t in range(20_001)), "20001 rows 20,000"),
        (HEADER + ROWS.replace("20,8", "20,1e308").replace("10,4", "10,-1e308"), "far apart"),
    ],
)
def test_mistakes_of_a_table_are_named_in_one_line(tmp_path: Path, text: str | None, culprits: str):
    if text is not None:
        (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError) as refused:
        load({"components": {"planner": str(tmp_path / "a.csv")}}, "python")
    assert mentions(str(refused.value), f"a.csv {culprits}"), refused.value
    assert "\n" not in str(refused.value)


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_both_kinds_and_the_program_have_the_same_rows(workplace: Path):
    """Tables of two vehicles have the same name, and not one of a module."""
    for k in (1, 2):
        Path(f"{k}").mkdir()
        table = np.column_stack([TIMES[:20] - TIMES[0], course(TIMES[:20]) + 9.0 * k])
        np.savetxt(f"{k}/5-9 'é'.csv", table, delimiter=",", header="t,x,y,z", comments="")
    scenario = {
        "vehicles": 2,
        "components": {f"auv{k}.planner": f"{k}/5-9 'é'.csv" for k in (1, 2)},
        "stop_time": 3.0,
    }
    python, native = (simulate(scenario, kind=kind) for kind in ("python", "native"))
    for name in python.columns:
        np.testing.assert_array_equal(python[name], native[name], name)
    apart = native["auv2.planner.y_d.x"] - native["auv1.planner.y_d.x"]
    np.testing.assert_allclose(apart, 9.0, atol=1e-9)
    Path("two.toml").write_text(
        "vehicles = 2\nstop_time = 3.0\n[components]\n"
        + "".join(f'"auv{k}.planner" = "{k}/5-9 \'é\'.csv"\n' for k in (1, 2))
    )
    assert main(["export", "two.toml", "--format", "fmu", "--out", "."]) == 0
    alone = simulate("two.fmu")
    for k in (1, 2):
        name = f"auv{k}.plant.eta.y"
        np.testing.assert_array_equal(alone[f"two.{name}"], native[name])


def test_check_names_what_a_run_refuses(tmp_path: Path):
    """With the parameters of the run; a jump is too fast."""
    table = tmp_path / "a.csv"
    table.write_text(HEADER + ROWS)
    scenario = {"components": {"planner": str(table)}, "parameters": {"planner.tau_max.u": 5.0}}
    _, system = load_scenario(scenario, "native")
    assert [*refusals(system.with_parameters({"planner.tau_max.u": 80.0}))] == []
    [text] = refusals(system)
    assert mentions(text, "planner: a.csv: at t = s surge force N limit of 5")
    table.write_text(HEADER + ROWS.replace("20,8", "20,48"))
    with pytest.raises(InputError, match=r"a\.csv: at t = 0 s, .* speed of .* limit of 2\.5"):
        simulate(scenario, {"planner.tau_max.u": 80.0}, kind="native", stop_time=1.0)
