"""Sections of scenarios, of the bundle's and of strangers'."""

from __future__ import annotations

from pathlib import Path

import pytest

from orchestrator.cosim import PortName, Table
from orchestrator.paper.kept_runs import Companion, KeptRun
from orchestrator.paper.report import draw_section, section_text, sections
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import names, read_scenario

INDICES = {
    "stop_time": 3.0,
    "l2_effort": [1.0, 2.0, 3.0],
    "saturated_fraction": [0.0, 0.5, 1.0],
    "final_error": [0.1, 0.2, 0.3],
    "velocities_reaching_controller": ["plant.dy.x"],
}


class Known:
    """Outcomes that nobody has to make."""

    def __init__(self, *metrics):
        self._metrics = list(metrics)
        self._runs = []

    def __getitem__(self, run):
        if run not in self._runs:
            self._runs.append(run)
        return KeptRun(self._metrics[self._runs.index(run)], Table())

    def label(self, run):
        return run.label


def stranger(folder: Path, name: str = "mine", **entries: str) -> str:
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


def test_names_of_strangers_do_not_collide(tmp_path):
    (tmp_path / "a").mkdir()
    file = stranger(tmp_path / "a", "fig3a")
    assert [section.name for section in sections(["fig3a", file, file])] == [
        "fig3a",
        "fig3a-2",
        "fig3a-3",
    ]


def test_labels_of_a_comparison_are_apart(tmp_path):
    compare = '{ name = "x", label = "proposed" }'
    [section] = sections([stranger(tmp_path, label='"proposed"', compare=compare)])
    assert list(section.runs) == ["proposed", "proposed (2)"]


def test_a_section_has_its_numbers_with_units_and_its_command(tmp_path):
    [section] = sections(["fig7a"])
    text = "\n\n".join(section_text(section, Known(INDICES), ["no velocity"], tmp_path))
    assert text.startswith("### Fig. 7(a): proposed controller under A_f = 1, A_d = 2\n")
    assert "| L2 effort (u, q, r) | 1 N·√s; 2, 3 N·m·√s |" in text
    assert "| share of saturated steps (u, q, r) | 0, 0.5, 1 |" in text
    assert "| final error (x, y, z) | 0.1, 0.2, 0.3 m |" in text
    assert "peak command" not in text
    assert "`auv-fmu run fig7a`, until 3 s" in text
    assert "reach the controller: `plant.dy.x`." in text
    assert "Note: no velocity." in text
    assert "- `controller.eps_t = 1.0`: as in Fig. 4; the paper names none" in text


def test_what_is_ours_may_be_anything(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('[wires]\n"a.b" = "c.d"\n[ours]\nwires = "w"\nlegend = "l"\nx.y = "z"\n')
    [section] = sections([str(file)])
    text = "\n\n".join(section_text(section, Known({"failure": "no"}), [], tmp_path))
    assert text.endswith("- `wires`: w\n- `legend`: l\n- `x.y`: z")


def test_a_failure_is_said(tmp_path):
    [section] = sections(["fig3a"])
    text = "\n\n".join(section_text(section, Known({"failure": "the <sea> is dry"}), [], tmp_path))
    assert r"**The run fig3a ended early:** the \<sea\> is dry" in text


def test_a_figure_that_there_is_not_is_a_note(tmp_path):
    [section] = sections([stranger(tmp_path, title='"Mine"', figure='"trackin"')])
    [note] = draw_section(section, [KeptRun(INDICES, Table())], tmp_path / "figures")
    assert "'trackin'" in note
    assert "tracking" in note


def test_a_run_without_rows_has_no_figure(tmp_path):
    [section] = sections(["fig3a"])
    assert draw_section(section, [KeptRun({"failure": "no"}, Table())], tmp_path / "f") == []
    assert not (tmp_path / "f").exists()


@pytest.mark.parametrize("name", names())
def test_what_is_ours_is_stated_in_the_file(name):
    """Every entry of [ours] names a value above it, and says why it is ours."""
    scenario = read_scenario(name)
    assert scenario.remark
    for entry, why in scenario.ours.items():
        assert why
        if "." in entry:
            assert PortName.read(entry) in scenario.parameters
        else:
            assert getattr(scenario, entry)


@pytest.mark.parametrize("name", [name for name in names() if name.startswith("fig")])
def test_what_the_paper_never_gives_is_ours(name):
    """End times and noise, and that Fig. 3 is without (56): readings 7 and 8."""
    scenario = read_scenario(name)
    assert {"stop_time", "plant.noise.std"} <= scenario.ours.keys()
    assert ("only" in scenario.ours) == (scenario.only == ["plant"])
