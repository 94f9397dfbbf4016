"""`auv-fmu live`: the page's rows in Node and in a browser, compared with the native FMUs."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from fmus.kinds import NATIVE
from orchestrator.commands.main import main
from orchestrator.cosim import Ending, Table
from orchestrator.figures import visible
from orchestrator.live import assembly, module, presets
from orchestrator.live.assembly import ENGINE
from orchestrator.live.module import live_module
from orchestrator.live.presets import live_page, page_data, preset, runs_of
from orchestrator.machine.compilers import FLAGS, machines_compiler
from orchestrator.machine.errors import InputError
from orchestrator.runs import bundle
from orchestrator.runs.own_components import new_controller
from orchestrator.runs.preparation import Prepared
from orchestrator.runs.scenario import names
from orchestrator.vehicle import reduction
from orchestrator.vehicle.indices import metrics, metrics_of
from support.browser import BROWSER, Browser, browser
from support.events import ALL, ENDS
from support.live import TOLERANCE, needs_npm, needs_zig
from support.tiers import slow

#: An installed package has no tests.
SCRIPTS = Path(__file__).parents[2] / "orchestrator" / "live" / "web" / "test"

pytestmark = [needs_npm, needs_zig]

#: Last compared time [s] of a chaotic run: 100 m away, the robust term of the PD controller
#: switches in every step.
CHAOTIC = {"fig6-pd": 10.0}

#: Larger tolerances: two vehicles come back to their leader with commands beyond their limits.
LARGER = {"formation-lost-link": 1e-5}

#: Sine and similar functions, which differ between C libraries in the last bit.
SAME_FUNCTIONS = Path(__file__).parents[1] / "support" / "same_functions.h"

#: Scenarios with each kind of component and loop; `-m slow` runs the others.
REPRESENTATIVES = ("fault-sensor", "fig3a", "fig6", "formation-lost-link", "remus", "sea")

#: Changes of settings, each from the ones before it: events and a path in others, other values.
CHANGES: list[dict[str, Any]] = [
    {"preset": "path", "events": "fault-sensor", "planner.waypoint[2].z": 2.5},
    {"preset": "fig4", "events": "fault-thruster", "stop_time": 70.0, "plant.noise.seed": 7},
    {"events": "", "stop_time": 10.01, "controller.saturation": "algebraic", "plant.roll": False},
    {"preset": "formation-v", "stop_time": 10.0, "auv2.controller.eps_t": 2, "vehicle": "auv2"},
]


class Parts(NamedTuple):
    """Parts of the page, as files."""

    engine: Path
    modules: list[Path]
    data: Path

    def node(self, script: str, *arguments: str, given: str = "") -> Any:
        """Run a script of the tests, which takes the parts first, and return its output."""
        modules = ",".join(map(str, self.modules))
        parts = (str(self.engine), modules, str(self.data))
        command = ["node", str(SCRIPTS / script), *parts, *arguments]
        process = subprocess.run(command, input=given, capture_output=True, text=True, check=False)
        assert process.returncode == 0, process.stderr
        return json.loads(process.stdout)


@pytest.fixture(scope="module")
def parts(script: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Parts:
    """Script, module and data."""
    folder = tmp_path_factory.mktemp("parts")
    return made(script[ENGINE], "fig4", folder)


def made(engine: Path, opened: str, folder: Path, alone: bool = False) -> Parts:
    """The parts of a page, with all scenarios or only the one that it opens."""
    data, programs = page_data(opened)
    if alone:
        data["presets"] = [preset for preset in data["presets"] if preset["name"] == data["opened"]]
    (folder / "data.json").write_text(json.dumps(data))
    modules = [live_module(program.sources)[module.MODULE] for program in programs]
    return Parts(engine, modules, folder / "data.json")


def rows_of(parts: Parts, name: str, folder: Path) -> dict[str, Any]:
    """Run a preset in Node: its rows go into files of a folder."""
    data = json.loads(parts.data.read_text())
    data["presets"] = [preset for preset in data["presets"] if preset["name"] == name]
    (folder / "one.json").write_text(json.dumps(data))
    return dict(parts._replace(data=folder / "one.json").node("rows.mjs", str(folder)))


@pytest.fixture(scope="module")
def opened(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A browser with the page."""
    if BROWSER is None:
        pytest.skip("Chromium is not installed")
    with browser(tmp_path_factory.mktemp("profile")) as found:
        found.open(page)
        yield found


@pytest.mark.parametrize(
    "name", [*REPRESENTATIVES, *slow(*(name for name in names() if name not in REPRESENTATIVES))]
)
def test_rows_events_and_indices_are_the_ones_of_the_native_fmus(name: str, parts: Parts, tmp_path):
    """For a scenario and its companion."""
    outcomes = rows_of(parts, name, tmp_path)
    for i, run in enumerate(map(compiled, runs_of(name))):
        table, outcome = Table(), outcomes[f"{name}.{i}"]
        ending = run.run([table])
        assert outcome["columns"] == [table.columns[i - 1] for i in places(table)[1:]]
        assert [tuple(event.values()) for event in outcome["happened"]] == [*ending.events]
        assert tuple(outcome["messages"]) == ending.messages
        assert outcome.get("failure") == ending.failure
        wanted = table.rows[:, places(table)]
        found = rows_in(tmp_path / f"{name}.{i}", wanted)
        compared = table.time <= CHAOTIC.get(run.scenario.name, np.inf)
        difference = np.abs(found - wanted) / np.maximum(1.0, np.abs(wanted))
        assert difference[compared].max() <= LARGER.get(run.scenario.name, TOLERANCE)
        compare_indices(run, table, found, outcome, OF_SINES)


def rows_in(file: Path, like: np.ndarray) -> np.ndarray:
    """The rows in a file of columns."""
    return np.ascontiguousarray(np.fromfile(file).reshape(like.shape[::-1]).T)


def compiled(run: Prepared) -> Prepared:
    """The run in the compiled loop, which is faster."""
    return replace(run, plan=replace(run.plan, loop="compiled"))


#: Indices that depend on such functions.
OF_SINES = ("final_error",)


def compare_indices(
    run: Prepared, table: Table, computed: np.ndarray, outcome: Any, near: Sequence[str]
):
    """Compare the indices of rows in Node with those that the master has of the same rows.

    Args:
        run: that was made.
        table: of the master.
        found: the rows in Node.
        outcome: of them.
        near: the indices that need not be the same bit for bit.

    """
    rows = table.rows.copy()
    rows[:, places(table)] = computed
    found = metrics_of(Table.of(table.header, rows), run.loops)
    together = {name: [value] for name, value in found.together.items()}
    assert len(together) == (len(run.loops) > 1)
    shown = {index.name for index in metrics()}
    for loop, measured in zip(run.loops, outcome["metrics"], strict=True):
        of_loop = found.found(loop)
        wanted = {name: of_loop[name] for name in of_loop.keys() & shown} | together
        assert measured.keys() == wanted.keys()
        for index, values in wanted.items():
            tolerance = TOLERANCE if index in near else 0.0
            assert measured[index] == pytest.approx(values, rel=tolerance, abs=tolerance), index


def places(table: Table) -> list[int]:
    """Columns that a program has, too: all except `fault`."""
    return [0, *(i for i, name in enumerate(table.columns, 1) if not name.endswith(".fault"))]


@pytest.mark.slow
@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_only_the_c_library_makes_rows_differ(parts: Parts, tmp_path, monkeypatch):
    """With the same functions in both, all rows and indices are equal bit for bit."""
    with monkeypatch.context() as patch:
        patch.setattr(module, "_FLAGS", (*module._FLAGS, "-include", str(SAME_FUNCTIONS)))
        content = module.compiled(presets.bundled().sources)[module.MODULE]
    (tmp_path / "same.wasm").write_bytes(content)
    rows_of(parts, "sea", tmp_path)
    other_rows = (tmp_path / "sea.0").read_bytes()
    same = parts._replace(modules=[tmp_path / "same.wasm"])
    fmus = with_same_functions(bundle.current_fmus(NATIVE), tmp_path)
    options = (*reduction._OPTIONS, "-include", str(SAME_FUNCTIONS))
    monkeypatch.setattr(reduction, "_OPTIONS", options)
    reduction.library_of.cache_clear()
    monkeypatch.setattr("orchestrator.runs.preparation.current_fmus", lambda *_: fmus)
    for name in REPRESENTATIVES:
        outcomes = rows_of(same, name, tmp_path)
        for i, run in enumerate(map(compiled, runs_of(name))):
            table, outcome = Table(), outcomes[f"{name}.{i}"]
            ending = run.run([table])
            wanted = table.rows[:, places(table)]
            found = rows_in(tmp_path / f"{name}.{i}", wanted)
            assert found.tobytes() == wanted.tobytes(), (name, i)
            assert outcome.get("failure") == ending.failure
            compare_indices(run, table, found, outcome, ())
    reduction.library_of.cache_clear()
    # Another C library gives other rows.
    assert (tmp_path / "sea.0").read_bytes() != other_rows


def with_same_functions(folder: Path, place: Path) -> Path:
    """The native FMUs, compiled with other functions of the C library."""
    made = place / "fmus"
    made.mkdir()
    for fmu in folder.glob("*.fmu"):
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(place / fmu.stem)
            [library] = (name for name in archive.namelist() if name.startswith("binaries/"))
        compiler = str(machines_compiler())
        command = [compiler, *FLAGS, "-include", str(SAME_FUNCTIONS), "fmi2.c", "-lm", "-o"]
        sources = place / fmu.stem / "sources"
        subprocess.run([*command, f"../{library}"], cwd=sources, check=True, capture_output=True)
        shutil.make_archive(str(place / fmu.stem), "zip", place / fmu.stem)
        (place / f"{fmu.stem}.zip").rename(made / fmu.name)
    return made


def test_events_of_all_kinds_do_what_they_do_in_the_master(parts: Parts, tmp_path):
    last = ENDS["chattering"] + ENDS["refused"]
    outcome, run = both(ALL.replace("LAST", last), parts, tmp_path)
    ending, table = compare(run, outcome, tmp_path)
    assert table.time[-1] == pytest.approx(18.0)
    assert [tuple(event.values()) for event in outcome["happened"]] == [*ending.events]
    assert len(ending.events) > 12
    assert outcome["failure"] == "stopped at t = 18 s: plant refused its step"
    assert str(ending.failure).startswith("stopped at t = 18 s: plant: ")


def test_vehicles_have_any_names_and_may_have_no_controller(parts: Parts, tmp_path):
    outcome, run = both('stop_time = 5.0\n[components]\ntow = "AuvPlant"\n', parts, tmp_path)
    compare(run, outcome, tmp_path)
    first, second = outcome["metrics"]
    assert first.keys() - second.keys() == {"final_error"}
    assert second["peak_command"] == [0.0, 0.0, 0.0]


def both(text: str, parts: Parts, folder: Path) -> tuple[Any, Prepared]:
    """Run a scenario in Node, and prepare it for the master."""
    scenario = folder / "mine.toml"
    scenario.write_text(text)
    outcome = made(parts.engine, str(scenario), folder, alone=True).node("rows.mjs", str(folder))
    return outcome["mine.0"], runs_of(str(scenario))[0]


def compare(run: Prepared, outcome: Any, folder: Path) -> tuple[Ending, Table]:
    """Compare rows and indices of a scenario's run in Node with the run itself."""
    table = Table()
    ending = run.run([table])
    wanted = table.rows[:, places(table)]
    found = rows_in(folder / "mine.0", wanted)
    assert found == pytest.approx(wanted, rel=TOLERANCE, abs=TOLERANCE)
    compare_indices(run, table, found, outcome, OF_SINES)
    return ending, table


def test_a_state_that_a_guard_starts_over_is_told(parts: Parts, tmp_path):
    """An observer restarts."""
    gate = "stop_time = 2.0\n[parameters]\ncontroller.innovation_gate = 1e-6\n"
    outcome, run = both(gate, parts, tmp_path)
    [message] = run.run([]).messages
    assert outcome["messages"] == [message]


def test_cautions_are_the_warnings_of_a_run(parts: Parts, tmp_path, capsys):
    """About the observer, the robust term and the vertical, each of its vehicle."""
    text = "vehicles = 2\nstop_time = 12.0\n[parameters]\nauv2.plant.eta0.x = 9.0\n"
    text += "auv1.controller.k_d = 150.0\nauv2.controller.eps_t = 1e-3\n"
    text += "auv2.plant.roll = false\nauv2.plant.eta0.theta = 1.5\nauv2.plant.nu0.q = 1.0\n"
    outcome, _ = both(text, parts, tmp_path)
    capsys.readouterr()
    main(["run", str(tmp_path / "mine.toml"), "--no-figures", "--out", str(tmp_path / "out")])
    warnings = re.findall(r"warning: mine: (.*)", capsys.readouterr().err)
    assert {*outcome["cautions"]} <= {*warnings}
    words = ("auv1.controller.k_d = 150 1/s is unstable", "auv2.controller.eps_t = 0.001 W")
    for word in (*words, "auv2.plant.roll = false"):
        assert sum(word in line for line in outcome["cautions"]) == 1, word


def test_signals_chatter_in_charts_as_in_figures(parts: Parts):
    """And have the same means: noise, noise with a trend, a step, and a slow wave."""
    random = np.random.default_rng(5)
    time = np.concatenate((0.02 * np.arange(900), 18.0 + 0.05 * np.arange(300)))
    noise = random.normal(size=len(time))
    signals = [noise, 3.0 * time + noise, 1e-5 * noise + (time > 9.0), np.sin(time)]
    given = json.dumps([row.tolist() for row in (time, *signals)])
    found = parts.node("chatter.mjs", given=given)
    for signal, (is_chatter, mean) in zip(signals, found, strict=True):
        assert is_chatter == visible.chatters(signal)
        wanted = visible.moving_mean(time, signal, visible.mean_window(time))
        np.testing.assert_allclose(mean, wanted, rtol=0.0, atol=1e-9)
    assert [is_chatter for is_chatter, _ in found] == [True, True, False, False]


def test_systems_of_a_users_own_run_in_the_page(parts: Parts, tmp_path):
    """With a component, an order and longer steps of its own; shorter steps are refused."""
    new_controller("my_law", tmp_path / "law")
    text = 'stop_time = 5.0\norder = "gauss-seidel"\n[steps]\ncontroller = 0.04\nplanner = 0.1\n'
    text += '[components]\ncontroller = "law/MyLaw.fmu"\n'
    outcome, run = both(text, parts, tmp_path)
    ending, _ = compare(run, outcome, tmp_path)
    assert outcome.get("failure") == ending.failure is None
    mine = made(parts.engine, str(tmp_path / "mine.toml"), tmp_path, alone=True)
    [refused] = mine.node("tables.mjs", given=json.dumps([{"step": 0.01}]))
    assert refused["refusal"] == (
        "step 0.01 s: a component takes longer steps, which are multiples of 0.02 s"
    )


def test_a_component_outside_the_language_is_refused_in_one_line(tmp_path, capsys):
    new_controller("other_law", tmp_path / "law", python=True)
    assert main(["live", str(tmp_path / "law" / "other_law.toml")]) == 2
    error = capsys.readouterr().err
    refusal = "other_law: the live page cannot run controller: OtherLaw.fmu is not a component"
    assert refusal in error
    assert error.count("\n") == 1
    new_controller("bad_law", tmp_path / "bad")
    script = tmp_path / "bad" / "bad_law.py"
    script.write_text(script.read_text().replace("    p, e,", "    assert {1: 2.0}\n    p, e,"))
    assert main(["build", str(script), "--kind", "python"]) == 0
    capsys.readouterr()
    assert main(["live", str(tmp_path / "bad" / "bad_law.toml")]) == 2
    error = capsys.readouterr().err
    assert "bad_law.py:" in error
    assert "a dict is not in the language of equations" in error
    assert error.count("\n") == 1


def test_tables_are_the_same_in_node_and_in_a_browser(parts: Parts, opened: Browser):
    """Bit for bit."""
    wanted = parts.node("tables.mjs", given=json.dumps(CHANGES))
    for changes, expected in zip(CHANGES, wanted, strict=True):
        digest = opened.evaluate(f"""(async () => {{
            await auvfmu.set({json.dumps(changes)});
            const bytes = new TextEncoder().encode(await auvfmu.csv());
            const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
            return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
        }})()""")
        assert digest == expected["digest"], changes
    assert opened.said == []
    # The page and its worker, and nothing else.
    assert {address.split(":")[0] for address in opened.requests} <= {"file", "blob"}


def test_refusal_is_the_line_of_the_fmu_and_changes_nothing(parts: Parts):
    changes = [
        {"stop_time": 1.0},
        {"plant.m11": -1.0},
        {"planner.sort": 1.0},
        {"plant.noise.seed": 2**32 + 1},
        {"stop_time": -1.0},
        {"stop_time": 1.0},
    ]
    before, refused, unknown, too_large, backwards, after = parts.node(
        "tables.mjs", given=json.dumps(changes)
    )
    assert re.fullmatch(r"plant: .*m11 = -1: must be at least 1e-09", refused["refusal"])
    assert "planner.sort" in unknown["refusal"]
    assert too_large["refusal"] == "plant.noise.seed = 4294967297: not a value of type Integer"
    assert "must be positive" in backwards["refusal"]
    assert after == before


def test_table_is_accepted_by_verify(opened: Browser, tmp_path, capsys):
    changes = {"controller.k_d": 25.0, "plant.noise.seed": 3}
    opened.evaluate(f"auvfmu.set({json.dumps({'preset': 'fig4', 'stop_time': 5.0, **changes})})")
    (tmp_path / "live.csv").write_text(opened.evaluate("auvfmu.csv()"))
    values = [word for name, value in changes.items() for word in ("--set", f"{name}={value}")]
    arguments = ["verify", str(tmp_path / "live.csv"), "--scenario", "fig4", *values]
    assert main([*arguments, "--tolerance", "1e-9"]) == 0
    assert "in feedthrough order" in capsys.readouterr().out
    # Without one of the changes it is another run.
    assert main(arguments[:-2]) == 2


def test_page_stands_by_itself_and_is_light(page: Path):
    text = page.read_text(encoding="utf-8")
    assert len(text.encode()) < 700_000
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", text)
    [policy] = re.findall(r'Content-Security-Policy" content="(.+?)"', text)
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe-inline" not in policy


#: Titles in the list of licences, each with how its text begins.
LICENCES = {
    "auv-fmu": "MIT License",
    "Zig, contained in the WebAssembly module": "The MIT License (Expat)",
    "wasi-libc, contained in the WebAssembly module": "wasi-libc as a whole",
    "wasi-libc, MIT License, contained in the WebAssembly module": "Permission is hereby granted",
    "musl, contained in the WebAssembly module": "musl as a whole",
    r"ogl [\d.]+, Unlicense": "This is free and unencumbered software",
    r"uplot [\d.]+, MIT": "The MIT License (MIT)",
}


def test_page_has_the_licence_of_each_thing_in_it(page: Path):
    [texts] = re.findall("<pre>(.+?)</pre>", page.read_text(encoding="utf-8"), re.DOTALL)
    for title, beginning in LICENCES.items():
        section = rf"^{title}\n\n{re.escape(beginning)}"
        assert re.search(section, texts, re.MULTILINE), title


def test_page_opens_a_file_of_the_users(tmp_path, opened: Browser):
    """With events of its own, which the scenarios of the list can also have."""
    scenario = tmp_path / "mine.toml"
    scenario.write_text(
        'title = "Mine <b>"\n[parameters]\nplant.noise.std = 0.0\n[[events]]\nat = 0.2\n'
        "stop = true\n"
    )
    page = live_page(str(scenario))
    assert "<title>Mine &lt;b&gt;</title>" in page
    (tmp_path / "mine.html").write_text(page, encoding="utf-8")
    opened.open(tmp_path / "mine.html")
    table = opened.evaluate("auvfmu.csv()").splitlines()
    assert len(table) == 1 + 11


def test_loops_are_told_apart_by_their_scenarios_and_drawn_in_one_order(tmp_path):
    """If both have the same controller; and in the same order whichever a scenario has."""
    (tmp_path / "mine.toml").write_text('compare = { name = "fig4" }\n')
    loops = preset(str(tmp_path / "mine.toml"))[0]["loops"]
    assert [loop["label"] for loop in loops] == ["mine", "fig4"]
    assert (preset("fig5")[0]["drawn"], preset("fig5-pd")[0]["drawn"]) == ([0, 1], [1, 0])


def test_events_keep_their_numbers_where_a_loop_lacks_others(tmp_path):
    """The PD controller has no k_d."""
    (tmp_path / "mine.toml").write_text(
        "[[events]]\nat = 1.0\nset = { controller.k_d = 20.0 }\n"
        "[[events]]\nat = 2.0\nset = { plant.current.x = 0.1 }\n"
    )
    own, other = preset(str(tmp_path / "mine.toml"))[0]["loops"]
    assert [event["number"] for event in own["events"]["mine"]] == [0, 1]
    assert [event["number"] for event in other["events"]["mine"]] == [1]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('[components]\ncontroller = "own.fmu"\n', "own.fmu"),
        ('only = ["planner"]\n', "without the plant"),
        ("stop_time = 1e6\n", "more than 200,000 steps"),
        ('coupling = "linear"\n', "linear"),
        ("[parameters]\nplant.m11 = -1.0\n", "m11 = -1"),
        ('compare = { name = "two", components.tow = "AuvPlant" }\n', "another number of vehicles"),
        ("vehicles = 11\n", "more than 10 vehicles"),
        ("vehicles = 2\nstop_time = 2001.0\n", "more than 100,000 steps"),
    ],
)
def test_scenarios_that_the_page_cannot_run_are_refused_in_one_line(text, why, tmp_path, capsys):
    (tmp_path / "mine.toml").write_text(text)
    assert main(["live", str(tmp_path / "mine.toml"), "--out", str(tmp_path / "page.html")]) == 2
    error = capsys.readouterr().err
    assert why in error
    assert error.count("\n") == 1
    assert not (tmp_path / "page.html").exists()


@pytest.mark.parametrize(
    ("make", "lacking", "wanted"),
    [
        (
            lambda: module.compiled(presets.bundled().sources),
            "module.zig",
            r"pip install 'auv-fmu\[native\]'",
        ),
        (assembly.bundled, "assembly.shutil.which", "Node.js"),
    ],
)
def test_missing_tools_of_the_page_are_named(
    make: Callable[[], object], lacking, wanted, monkeypatch
):
    monkeypatch.setattr(f"orchestrator.live.{lacking}", lambda *_: None)
    with pytest.raises(InputError, match=wanted):
        make()


def test_npm_without_a_registry_is_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("npm_config_registry", "http://127.0.0.1:9")
    monkeypatch.setenv("npm_config_cache", str(tmp_path))
    monkeypatch.setattr(assembly, "_OPTIONS", (*assembly._OPTIONS, "--fetch-retries=0"))
    with pytest.raises(InputError, match=r"npm ci: npm .*ECONNREFUSED") as refusal:
        assembly.bundled()
    assert "\n" not in str(refusal.value)
