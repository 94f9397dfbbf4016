"""Runs of the report, and sections of scenarios of the bundle and of users."""

from __future__ import annotations

from pathlib import Path

import pytest

from orchestrator.cosim import PortName, Table
from orchestrator.paper.claims import CLAIMS, KeptRun
from orchestrator.paper.effects import EFFECTS
from orchestrator.paper.report import Companion, draw_section, make_runs, section_text, sections
from orchestrator.runs.preparation import prepare_request
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import names, read_scenario
from support.runs import PD, InThisProcess

QUIET = Request("fig4", {"plant.noise.std": 0.0})


@pytest.mark.parametrize(
    ("run", "label"),
    [
        (Request("fig4"), "fig4"),
        (QUIET, "fig4 --set plant.noise.std=0"),
        (Request("fig5", {"controller.printed_jacobian": True}),
         "fig5 --set controller.printed_jacobian=true"),
        (Request("fig4", {"plant.noise.std": 1.23456789e-05}),
         "fig4 --set plant.noise.std=1.23456789e-05"),
        (Request("my file.toml", order="jacobi", stop_time=2.5, step=0.01),
         "'my file.toml' --stop-time 2.5 --step 0.01 --order jacobi"),
        (Request("fig4", events="fig6", steps={"controller": 0.2}),
         "fig4 --events fig6 (steps: controller = 0.2 s)"),
        (Request("fig4", events=[{"at": 1.0, "set": {"plant.noise.std": 0.0}}], loop="python"),
         "fig4 --loop python (events: {'at': 1.0, 'set': {'plant.noise.std': 0.0}})"),
        (Request("fig4", events=[]), "fig4 (events: none)"),
    ],
)  # fmt: skip
def test_the_label_is_the_command_with_other_settings_in_parentheses(run, label):
    assert run.label == label


def test_a_companion_is_made_by_the_command_of_its_scenario(tmp_path):
    own = tmp_path / "own.toml"
    own.write_text('order = "jacobi"\nstop_time = 0.1\n[steps]\ncontroller = 0.2\n' + PD)
    own, companion = Request(str(own)), Companion(str(own))
    runs = make_runs([own, companion], InThisProcess())
    assert runs[companion].label == f"{own.label} (its companion)"
    assert runs[companion].metrics["scenario"] == "pd"
    assert "velocities_reaching_controller" in runs[companion].metrics
    for run in runs.values():
        assert run.metrics["order"] == "jacobi"
        assert run.table.header.experiment.stop_time == 0.1


def test_a_companion_that_is_also_a_scenario_has_its_label():
    runs = make_runs([Companion("fig5"), Request("fig5-pd")], InThisProcess(), stop_time=0.1)
    companion, scenario = runs.values()
    assert companion is scenario
    assert companion.label == "fig5-pd --stop-time 0.1"


def test_equal_runs_are_made_once(tmp_path):
    copy = tmp_path / "copy.toml"
    copy.write_text('title = "Another"\nstop_time = 100.0\n')
    slow = tmp_path / "slow.toml"
    slow.write_text("stop_time = 100.0\n[steps]\ncontroller = 0.2\n")
    default = {"plant.noise.std": 0.001}
    equal = [Request("fig4"), Request("fig4", default), Request(str(copy), default)]
    others = [
        QUIET,
        Request("fig4", order="jacobi"),
        Request("fig4", step=0.01),
        Request("fig5"),
        Request("fig5-pd"),
        Request(str(slow)),
    ]
    crew = InThisProcess()
    runs = make_runs([*others, *equal, QUIET], crew, stop_time=0.1)
    assert len(crew.done) == 1 + len(others)
    assert runs[equal[0]] is runs[equal[1]] is runs[equal[2]]
    assert runs[equal[1]].label == "fig4 --stop-time 0.1"
    assert len(runs[QUIET].table) == 6
    assert runs[QUIET].metrics["stop_time"] == 0.1


def test_a_run_that_cannot_be_made_has_its_reason():
    crew = InThisProcess()
    [run] = make_runs([Request("fig4", {"plant.noise.sdt": 0.0})], crew).values()
    assert crew.done == []
    assert "did you mean noise.std" in run.failure
    assert run.label == "fig4 --set plant.noise.sdt=0"
    assert len(run.table) == 0


def test_every_run_of_claims_and_effects_can_be_made():
    for run in {run for each in (*CLAIMS, *EFFECTS) for run in each.runs}:
        prepare_request(run)


# Sections


INDICES = {
    "stop_time": 3.0,
    "l2_effort": [1.0, 2.0, 3.0],
    "saturated_fraction": [0.0, 0.5, 1.0],
    "final_error": [0.1, 0.2, 0.3],
    "velocities_reaching_controller": ["plant.dy.x"],
}


def text_of(section, metrics, folder, notes=()):
    """The section of a scenario without a companion, for a run with some metrics."""
    [request] = section.runs.values()
    runs = {request: KeptRun(metrics, Table(), label=request.label)}
    return "\n\n".join(section_text(section, runs, notes, folder))


def user_file(folder: Path, name: str = "mine", **entries: str) -> str:
    file = folder / f"{name}.toml"
    file.write_text("".join(f"{key} = {value}\n" for key, value in entries.items()))
    return str(file)


def test_a_scenario_is_drawn_with_its_companion_or_its_twin_without_noise():
    runs = {section.name: section.runs for section in sections(["fig4", "fig5", "fig7a"])}
    assert runs["fig4"] == {
        "with noise": Request("fig4"),
        "without noise": Request("fig4", {"plant.noise.std": 0.0}),
    }
    assert runs["fig5"] == {"proposed": Request("fig5"), "PD": Companion("fig5")}
    assert runs["fig7a"] == {"fig7a": Request("fig7a")}


def test_names_of_sections_differ(tmp_path):
    (tmp_path / "a").mkdir()
    file = user_file(tmp_path / "a", "fig3a")
    assert [section.name for section in sections(["fig3a", file, file])] == [
        "fig3a",
        "fig3a-2",
        "fig3a-3",
    ]


def test_labels_of_a_comparison_differ(tmp_path):
    compare = '{ name = "x", label = "proposed" }'
    [section] = sections([user_file(tmp_path, label='"proposed"', compare=compare)])
    assert list(section.runs) == ["proposed", "proposed (2)"]


def test_a_section_has_its_numbers_with_units_and_its_command(tmp_path):
    [section] = sections(["fig7a"])
    text = text_of(section, INDICES, tmp_path, ["no velocity"])
    assert text.startswith("### Fig. 7(a): proposed controller under A_f = 1, A_d = 2\n")
    assert "| L2 effort (u, q, r) | 1 N·√s; 2, 3 N·m·√s |" in text
    assert "| share of saturated steps (u, q, r) | 0, 0.5, 1 |" in text
    assert "| final error (x, y, z) | 0.1, 0.2, 0.3 m |" in text
    assert "peak command" not in text
    assert "`auv-fmu run fig7a`, until 3 s" in text
    assert "reach the controller: `plant.dy.x`." in text
    assert "Note: no velocity." in text
    assert "- `controller.eps_t = 1.0`: as in Fig. 4; the paper names none" in text


def test_entries_of_the_table_ours_are_listed(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('[wires]\n"a.b" = "c.d"\n[ours]\nwires = "w"\nlegend = "l"\nx.y = "z"\n')
    [section] = sections([str(file)])
    text = text_of(section, {"failure": "no"}, tmp_path)
    assert text.endswith("- `wires`: w\n- `legend`: l\n- `x.y`: z")


def test_a_section_has_the_reason_of_a_failure(tmp_path):
    [section] = sections(["fig3a"])
    text = text_of(section, {"failure": "the <sea> is dry"}, tmp_path)
    assert r"**The run fig3a ended early:** the \<sea\> is dry" in text


def test_an_unknown_figure_is_a_note(tmp_path):
    [section] = sections([user_file(tmp_path, title='"Mine"', figure='"trackin"')])
    [note] = draw_section(section, [KeptRun(INDICES, Table())], tmp_path / "figures")
    assert "'trackin'" in note
    assert "tracking" in note


def test_a_run_without_rows_has_no_figure(tmp_path):
    [section] = sections(["fig3a"])
    assert draw_section(section, [KeptRun({"failure": "no"}, Table())], tmp_path / "f") == []
    assert not (tmp_path / "f").exists()


@pytest.mark.parametrize("name", names())
def test_entries_of_the_table_ours_are_values_with_reasons(name):
    scenario = read_scenario(name)
    assert scenario.remark
    for entry, why in scenario.ours.items():
        assert why
        if "." in entry:
            assert PortName.read(entry) in scenario.parameters
        else:
            assert getattr(scenario, entry)


@pytest.mark.parametrize("name", [name for name in names() if name.startswith("fig")])
def test_end_times_and_noise_are_ours(name):
    """The paper does not give them, nor that Fig. 3 is without (56): readings 7 and 8."""
    scenario = read_scenario(name)
    assert {"stop_time", "plant.noise.std"} <= scenario.ours.keys()
    assert ("only" in scenario.ours) == (scenario.only == ["plant"])
