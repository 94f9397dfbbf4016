"""Plots of any signals: the columns drawn, their panels and labels."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.cosim import Ending, Occurrence, PortName, Table
from orchestrator.figures.drawing import plot, save, told_apart
from orchestrator.figures.style import Drawn
from orchestrator.machine.errors import InputError
from orchestrator.vehicle.signals import Loop
from support.tables import loop_table, table_of

TIME = 0.02 * np.arange(10)


def drawn(figure):
    """Lines by the labels of their panels and their own."""
    return {
        (axes.get_ylabel(), line.get_label()): np.array(line.get_data())
        for axes in figure.axes
        for line in axes.get_lines()
    }


def test_members_of_a_group_with_one_unit_share_a_panel():
    table = loop_table()
    lines = drawn(plot([Drawn("run", table)], ["plant.eta"]))
    assert set(lines) == {
        *(("plant.eta\n[m]", k) for k in "xyz"),
        *(("plant.eta\n[rad]", k) for k in ("phi", "theta", "psi")),
    }
    for (_, member), line in lines.items():
        np.testing.assert_array_equal(line, (table.time, table[f"plant.eta.{member}"]))


def test_runs_share_a_panel_with_a_label_each():
    first, second = loop_table(), loop_table(seed=2)
    lines = drawn(plot([Drawn("first", first), Drawn("second", second)], ["plant.eta.x"]))
    for label, table in (("first", first), ("second", second)):
        np.testing.assert_array_equal(lines["plant.eta.x\n[m]", label][1], table["plant.eta.x"])


@pytest.mark.parametrize("n", [2, 3, 7])
def test_legends_of_many_runs_leave_the_panels_their_room(n, tmp_path):
    """Colours of members are explained in the panel, styles of runs above all panels."""
    labels = [f"another scenario with a long name, controller.k_p = {i}" for i in range(n)]
    figure = plot([Drawn(label, loop_table()) for label in labels], ["plant.eta", "plant.tau"])
    save(figure, tmp_path / "plot.png")
    [runs] = figure.legends
    assert [text.get_text() for text in runs.texts] == labels
    assert {line.get_color() for line in runs.get_lines()} == {"black"}
    page = figure.bbox
    for axes in figure.axes:
        assert axes.get_position().width > 0.75
        for legend in filter(None, (runs, axes.get_legend())):
            box = legend.get_window_extent()
            assert page.x0 <= box.x0 and box.x1 <= page.x1 and box.y1 <= page.y1
            assert not box.overlaps(axes.get_window_extent())
    members = figure.axes[0].get_legend()
    assert [text.get_text() for text in members.texts] == ["x", "y", "z"]
    assert len({line.get_color() for line in members.get_lines()}) == 3


def test_an_angle_that_wraps_has_a_gap():
    table = loop_table()
    yaw = np.remainder(np.linspace(0.0, 9.0, len(table)) + np.pi, 2.0 * np.pi) - np.pi
    table["plant.eta.psi"][:] = yaw
    [[_, line]] = drawn(plot([Drawn("run", table)], ["plant.eta.psi"])).values()
    wraps = np.flatnonzero(np.isnan(line))
    # Between 0 and 9 it passes pi, and does not reach 3 pi.
    assert len(wraps) == 1
    assert line[wraps[0] - 1] > 3.0 and line[wraps[0] + 1] < -3.0
    np.testing.assert_array_equal(line[~np.isnan(line)], yaw)


def test_a_signal_that_one_run_lacks_is_drawn_of_the_other():
    own = table_of(TIME, mine__a=np.arange(10.0))
    lines = drawn(plot([Drawn("loop", loop_table()), Drawn("own", own)], ["mine.a"]))
    np.testing.assert_array_equal(lines["mine.a", "own"][1], np.arange(10.0))


def test_a_panel_says_which_runs_are_not_in_it():
    """For example a user's own controller without an error, compared with the paper's."""
    own = Drawn("own", table_of(TIME, plant__tau__u=1.0))
    paper = Drawn("paper", table_of(TIME, plant__tau__u=2.0, controller__e__x=0.0))
    for runs, words in (([own, paper], "not in own"), ([own, own, paper], "not in 2 of the runs")):
        titles = {axes.get_ylabel(): axes.get_title("right") for axes in plot(runs).axes}
        assert titles == {"plant.tau.u": "", "controller.e.x": words}


def test_without_patterns_the_loops_of_all_vehicles_are_drawn():
    labels = [axes.get_ylabel() for axes in plot([Drawn("run", loop_table())]).axes]
    assert labels == ["plant.tau.u\n[N]", "plant.tau\n[N·m]", "controller.theta_hat"]
    table = table_of(TIME, a__tau__u=1.0, b__tau__u=2.0, b__law__e__x=0.0, other=3.0)
    loops = (Loop("a", "a.law"), Loop("b", "b.law"))
    figure = plot([Drawn("run", table, loops=loops)])
    assert [axes.get_ylabel() for axes in figure.axes] == ["a.tau.u", "b.tau.u", "b.law.e.x"]


def test_runs_that_differ_in_events_only_are_labelled_by_them():
    table = loop_table()
    happened = (Occurrence(2.0, "drop plant.y", "no position"), Occurrence(4.0, "ended"))
    runs = [
        Drawn("fig4", Table.of(table.header, table.rows, Ending(events=events)))
        for events in ((), happened)
    ]
    assert [run.label for run in told_apart(runs)] == ["no event", "no position at 2 s"]
    numbered = ["fig4 (1)", "fig4 (2)", "fig4 (3)"]
    assert [run.label for run in told_apart([*runs, runs[0]])] == numbered


def test_labels_do_not_depend_on_where_the_name_of_a_component_ends():
    """A record does not contain it."""
    split = (
        {PortName("a", "b.k"): 1.0, PortName("a", "b.n"): 3},
        {PortName("a.b", "k"): 2.0, PortName("a.b", "n"): 3},
    )
    runs = [Drawn("s", table_of(TIME, values, a__b__y=0.0)) for values in split]
    assert [run.label for run in told_apart(runs)] == ["a.b.k = 1", "a.b.k = 2"]


def test_runs_without_labels_have_the_names_of_their_scenarios():
    runs = [Drawn("fig4", loop_table(), name="fig4"), Drawn("PD", loop_table(), name="fig5-pd")]
    assert [run.label for run in told_apart(runs)] == ["fig4", "fig5-pd"]
    both = [runs[0]._replace(label="proposed"), runs[1]]
    assert [run.label for run in told_apart(both)] == ["proposed", "PD"]


def test_given_labels_are_for_all_runs():
    runs = [Drawn("fig4", loop_table()), Drawn("fig5", loop_table())]
    assert [run.label for run in told_apart(runs, labels=["a", "b"])] == ["a", "b"]
    for labels, text in (
        ("ab", "texts in a list"),
        (["a"], "1 labels for 2"),
        (["a", "a"], "must differ"),
    ):
        with pytest.raises(InputError, match=text):
            told_apart(runs, labels=labels)


def test_unknown_columns_are_refused_with_a_hint():
    with pytest.raises(InputError, match=r"no column matches 'plant.ta'; did you mean plant.ta"):
        plot([Drawn("run", loop_table())], ["plant.ta"])


def test_without_a_vehicle_every_signal_that_changes_is_drawn_up_to_twelve_panels():
    moving = {f"mine__y{i}": TIME * i for i in range(1, 15)}
    table = table_of(TIME, mine__idle=0.0, **moving)
    with pytest.warns(UserWarning, match="first 12 of 14 groups .* such as mine.y13"):
        panels = [axes.get_ylabel() for axes in plot([Drawn("own", table)]).axes]
    assert panels == [f"mine.y{i}" for i in range(1, 13)]
    still = table_of(TIME, mine__a__x=0.0, mine__a__y=0.0, mine__b=1.0)
    assert [axes.get_ylabel() for axes in plot([Drawn("own", still)]).axes] == ["mine.a", "mine.b"]


def test_values_that_no_axis_can_show_are_refused(tmp_path):
    figure = plot(
        [Drawn("own", table_of(TIME, mine__a=np.linspace(-1.7, 1.7, 10) * 1e308))], ["mine.a"]
    )
    with pytest.raises(InputError, match="too far apart to draw"):
        save(figure, tmp_path / "plot.png")
    assert list(tmp_path.iterdir()) == []


def test_a_group_has_a_panel_for_each_unit_of_its_fmu():
    """The members of a vector share a panel."""
    line = np.linspace(0.0, 1.0, 10)
    names = ("own__F__x", "own__F__y", "own__M__z", "own__a", "own__k__1", "own__k__2")
    table = table_of(
        line, **{name.replace("__1", "[1]").replace("__2", "[2]"): line for name in names}
    )
    units = {
        "own.F.x": "N", "own.F.y": "N.m", "own.M.z": "N.m", "own.a": "m/s2", "own.k[1]": "N",
    }  # fmt: skip
    table.header = replace(table.header, units=units)
    labels = [axes.get_ylabel() for axes in plot([Drawn("run", table)], ["own.*"]).axes]
    assert labels == ["own.F.x\n[N]", "own.F.y\n[N·m]", "own.M.z\n[N·m]", "own.a\n[m/s²]", "own.k"]
