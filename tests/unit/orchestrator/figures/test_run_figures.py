"""Figures show the numbers of the table and the events, and say which panels are missing."""

from __future__ import annotations

import logging
import subprocess
import warnings
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from shutil import which

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from orchestrator.cosim import Ending, Occurrence, PortName, Table
from orchestrator.figures.drawing import compose, draw, one_figure, plot, save
from orchestrator.figures.run_figures import FIGURES, FLEET, check_figure
from orchestrator.figures.style import COLOURS, Drawn, Look
from orchestrator.machine.errors import InputError
from orchestrator.vehicle.signals import STANDARD
from support.machine import contents
from support.tables import at_its_time, fleet, fleet_table, loop_table
from support.tiers import slow


def panel(figure, label):
    """The axes whose vertical axis has a label."""
    [axes] = [axes for axes in figure.axes if axes.get_ylabel() == label]
    return axes


def lines(axes):
    return [np.array(line.get_data()) for line in axes.get_lines()]


def notes_of(kind, *tables, folder: Path):
    return draw(kind, "", [Drawn(f"run {i}", t) for i, t in enumerate(tables)], folder, "f")


def test_lines_hold_the_numbers_of_the_table():
    table = loop_table()
    figure, notes = compose("", FIGURES["tracking"][""], [Drawn("run", table)])
    assert notes == []
    estimates = lines(panel(figure, "estimate"))
    for i, line in enumerate(estimates, start=1):
        np.testing.assert_array_equal(
            line, (table.time[:-1], table[f"controller.theta_hat[{i}]"][:-1])
        )
    # The command of the last row never acts.
    command = lines(panel(figure, r"$\tau_q$ [N·m]"))[0]
    np.testing.assert_array_equal(command[1][:-1], table["plant.tau.q"][:-1])
    # (9) at no attitude at all would be eta + ell e1; here against its x component.
    x, theta, psi = (table[f"plant.eta.{k}"] for k in ("x", "theta", "psi"))
    error = x + 0.35 * np.cos(psi) * np.cos(theta) - table["planner.y_d.x"]
    np.testing.assert_allclose(lines(panel(figure, "error [m]"))[0][1], error, atol=1e-12)


@pytest.mark.parametrize("figure", FIGURES)
def test_lines_do_not_depend_on_the_order_of_evaluation(figure):
    table = loop_table(order="gauss-seidel")
    acting = (*STANDARD.commanded, *STANDARD.dy_hat, *STANDARD.theta_hat)
    for rows in FIGURES[figure].values():
        first, second = (
            [line.tolist() for axes in compose("", rows, [Drawn("run", each)])[0].axes
             for line in lines(axes)]
            for each in (table, at_its_time(table, acting))
        )  # fmt: skip
        assert first == second


@pytest.mark.parametrize("z_up", [False, True])
def test_axes_of_a_path_say_which_way_they_point(z_up):
    figure, _ = compose("", FIGURES["tracking"][""], [Drawn("run", loop_table(), z_up)])
    [axes] = [axes for axes in figure.axes if axes.name == "3d"]
    names = {text.get_text() for text in axes.texts}
    assert names == {
        "x north [m]",
        *(("y west [m]", "z up [m]") if z_up else ("y east [m]", "z down [m]")),
    }
    # Right-handed: both are turned around, or neither.
    assert axes.zaxis_inverted() == axes.yaxis_inverted() == (not z_up)


def test_panels_end_together():
    table = loop_table()
    figure, _ = compose("", FIGURES["tracking"][""], [Drawn("run", table)])
    flat = [axes for axes in figure.axes if axes.name != "3d"]
    assert {axes.get_xlim() for axes in flat} == {(0.0, table.time[-1])}
    assert lines(panel(figure, r"$\tau_u$ [N]"))[0][0][-1] == table.time[-1]


@pytest.mark.parametrize(
    ("without", "name", "reason"),
    [
        (STANDARD.theta_hat, "estimated parameters", "the run has no controller.theta_hat[1]"),
        (STANDARD.y_d, "tracking errors", "the run has no planner.y_d.x"),
        (STANDARD.commanded, "commands", "the run has no plant.tau.u"),
    ],
)
def test_a_panel_without_signals_is_left_out_with_a_note(without, name, reason):
    """A user's own controller need not estimate anything."""
    _, notes = compose("", FIGURES["tracking"][""], [Drawn("run", loop_table(without=without))])
    assert f"panel {name!r} left out: {reason}" in notes


def test_a_figure_without_signals_is_left_out_with_a_note(tmp_path):
    notes = notes_of("tracking", loop_table(without=STANDARD.dy_hat), folder=tmp_path)
    assert notes == ["figure f-velocity left out: the run has no controller.dy_hat.x"]
    assert {path.name for path in tmp_path.iterdir()} == {"f.png", "f.svg"}


@pytest.mark.parametrize("kind", FIGURES)
def test_a_run_without_a_vehicle_has_no_figure_and_one_note(tmp_path, kind):
    of_vehicle = (*STANDARD.posture, *STANDARD.nu, *STANDARD.commanded)
    without = (*of_vehicle, *STANDARD.theta_hat, *STANDARD.dy_hat)
    [note] = notes_of(kind, loop_table(without=without), folder=tmp_path)
    assert note.startswith("no figure: the run has no plant.")
    assert not list(tmp_path.iterdir())


def test_a_run_without_a_step_has_no_figure(tmp_path):
    assert notes_of("tracking", loop_table(1), folder=tmp_path) == [
        "no figure: the run has no step"
    ]


def test_a_companion_that_lacks_something_is_named(tmp_path):
    companion = loop_table(without=STANDARD.y_d)
    notes = notes_of("comparison-errors", loop_table(), companion, folder=tmp_path)
    assert "panel 'tracking errors' left out for run 1, which has no planner.y_d.x" in notes


def test_colours_belong_to_runs():
    """A run without a signal does not pass its colour on."""
    tables = (loop_table(), loop_table(without=STANDARD.y_d), loop_table())
    runs = [Drawn(name, table) for name, table in zip("abc", tables, strict=True)]
    figure = one_figure("overlay", "", runs)
    [names] = figure.legends
    assert [text.get_text() for text in names.texts] == ["a", "b", "c"]
    a, b, c = (line.get_color() for line in names.get_lines())
    assert len({a, b, c}) == 3
    for label, colours in (("$e_x$ [m]", [a, c]), (r"$\tau_q$ [N·m]", [a, b, c])):
        drawn = [line.get_color() for line in panel(figure, label).get_lines()]
        assert drawn[: len(colours)] == colours


@pytest.mark.parametrize("kind", ["comparison", "overlay", "tracking"])
@pytest.mark.parametrize("n", [2, 7])
def test_long_names_leave_the_panels_their_room(kind, n):
    """The legend is above all panels, on the page, and nothing overlaps it."""
    names = [f"my controller with a notch filter, no. {i}" for i in range(n)]
    table = loop_table()
    table["plant.tau.u"][200] = -366.0
    figure, _ = compose(
        "A long heading, " * 8, FIGURES[kind][""], [Drawn(name, table) for name in names]
    )
    figure.draw_without_rendering()
    page, [legend] = figure.bbox, figure.legends
    assert [text.get_text() for text in legend.texts] == names
    box = legend.get_window_extent()
    assert page.x0 <= box.x0 and box.x1 <= page.x1 and box.y1 <= page.y1
    for axes in figure.axes:
        assert axes.get_position().width > 0.28
        legends = filter(None, [axes.get_legend()])
        titles = (axes.title, *(legend.get_title() for legend in legends))
        for part in (axes, *axes.texts, *titles):
            assert not box.overlaps(part.get_window_extent())
        for text in axes.texts:
            left = page if axes.name == "3d" else axes.bbox
            assert left.x0 <= text.get_window_extent().x0


def test_a_figure_of_one_run_names_no_others():
    """Its colours distinguish signals."""
    runs = [Drawn(name, loop_table()) for name in "ab"]
    figure, _ = compose("Fig. 4", FIGURES["tracking"]["-velocity"], runs)
    assert figure.legends == []
    assert figure.get_suptitle() == "Fig. 4"


def test_a_command_that_is_cut_off_says_its_peak():
    table = loop_table()
    table["plant.tau.u"][200] = -366.0
    figure, _ = compose("", FIGURES["tracking"][""], [Drawn("run", table)])
    axes = panel(figure, r"$\tau_u$ [N]")
    assert axes.get_ylim()[0] > -366.0
    assert {text.get_text() for text in axes.texts} == {"limits ±80 N", "peak \N{MINUS SIGN}366 N"}


def test_a_figure_has_no_heading_where_none_is_given():
    run = Drawn("run", loop_table())
    with_title, _ = compose("Fig. 4", FIGURES["tracking"][""], [run])
    without, _ = compose("", FIGURES["tracking"][""], [run])
    assert with_title.get_suptitle() == "Fig. 4"
    assert without.get_suptitle() == ""
    assert without.get_figheight() < with_title.get_figheight()


def test_nothing_is_drawn_after_stop(tmp_path):
    run = Drawn("run", loop_table())
    assert draw("tracking", "", [run], tmp_path, "f", stop=lambda: True) == []
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_equal_runs_give_equal_files(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        notes_of("comparison", loop_table(), loop_table(seed=2), folder=tmp_path / name)
    assert contents(tmp_path / "a").keys() == {"f.png", "f.svg"}
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


@pytest.mark.parametrize("value", slow(np.nan, 2e8, 1e-9, np.inf))
def test_matplotlib_warns_of_nothing(tmp_path, caplog, value):
    table = loop_table()
    for column in (*STANDARD.commanded, *STANDARD.theta_hat, *STANDARD.dy_hat):
        table[column][200:] = value
    with warnings.catch_warnings(), caplog.at_level(logging.WARNING):
        warnings.simplefilter("error")
        for kind in ("tracking", "comparison"):
            draw(kind, "標題", [Drawn("run", table), Drawn("other", loop_table())], tmp_path, kind)
    assert caplog.records == []


def test_an_unknown_figure_is_refused_with_a_hint():
    with pytest.raises(InputError, match="no figure 'trakking'; did you mean tracking"):
        check_figure("trakking")
    with pytest.raises(InputError, match="no figure 'none'; there are tracking"):
        check_figure("none")


def with_waypoints(points):
    """A run with waypoints, and the one after the last that counts."""
    table = loop_table()
    known = {PortName.read("planner.count"): len(points)} | {
        PortName.read(f"planner.waypoint[{k}].{axis}"): value
        for k, point in enumerate([*points, [9.0, 9.0, 9.0]], start=1)
        for axis, value in zip("xyz", point, strict=True)
    }
    header = replace(table.header, parameters={**table.parameters, **known})
    return Drawn("run", Table.of(header, table.rows))


def test_waypoints_are_in_the_path():
    points = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])
    figure, _ = compose("", FIGURES["tracking"][""], [with_waypoints(points)])
    [axes] = [axes for axes in figure.axes if axes.name == "3d"]
    [marks] = [marks for marks in axes.collections if marks.get_label() == "waypoints"]
    np.testing.assert_array_equal(np.column_stack(marks._offsets3d), points)


def test_names_of_a_flat_path_are_on_the_page_below_five_entries_of_its_legend():
    run = with_waypoints([(0.0, 0.0, 0.0), (150.0, 0.0, 8.0), (150.0, 120.0, 8.0)])
    figure = one_figure("tracking", "", [run])
    FigureCanvasAgg(figure).draw()
    [axes] = [axes for axes in figure.axes if axes.name == "3d"]
    assert len(axes.get_legend().get_texts()) == 5
    assert [text.get_text() for text in axes.texts] == ["x north [m]", "y east [m]", "z down [m]"]
    for text in axes.texts:
        assert figure.bbox.count_contains(text.get_window_extent().corners()) == 4


# Figures for a paper


@pytest.mark.parametrize("width", [3.5, 7.0])
def test_texts_are_apart_and_on_the_page(width, tmp_path, monkeypatch):
    """In one column and in two; only texts that are drawn count."""
    one, three = loop_table(seed=3), fleet_table(3)
    one["plant.tau.u"][200] = -366.0
    events = Ending(events=(Occurrence(2.0, "a", "fault", 0), Occurrence(2.1, "b", "gust", 1)))
    runs = [
        Drawn("proposed", Table.of(one.header, one.rows, events)),
        Drawn("PD", loop_table(seed=4)),
        Drawn("MPC", loop_table(seed=5)),
    ]
    vehicles = [Drawn(run.label, three, loops=fleet(3)) for run in runs[:2]]
    look, title = Look(width=width, size=8.0), "A heading that is longer than a column is wide"
    figures = [
        one_figure("tracking", title, runs[:1], look=look),
        one_figure("comparison", title, [run._replace(z_up=True) for run in runs[:2]], look=look),
        one_figure(FLEET, title, vehicles, look=look),
        plot(runs, ["plant.eta", "plant.tau", "controller.theta_hat"], title, look),
    ]
    drawn: set[Text] = set()
    original = Text.draw
    monkeypatch.setattr(
        Text, "draw", lambda text, *rest, **more: (drawn.add(text), original(text, *rest, **more))
    )
    for figure in figures:
        assert figure.get_figwidth() == width
        canvas = FigureCanvasAgg(figure)
        save(figure)
        drawn.clear()
        canvas.draw()
        boxes = [
            (text.get_text(), text.get_window_extent())
            for text in drawn
            if text.get_text() and text.get_visible()
        ]
        page = figure.bbox.padded(1)
        off_page = [name for name, box in boxes if page.count_contains(box.corners()) < 4]
        # Boxes are a pixel larger than what is drawn.
        touching = [
            (a, b)
            for (a, box), (b, other) in combinations(boxes, 2)
            if box.padded(-1).overlaps(other.padded(-1))
        ]
        assert (off_page, touching) == ([], [])


@pytest.mark.parametrize("width", [3.5, 7.0])
def test_fonts_of_a_pdf_are_truetype_and_texts_of_an_svg_are_texts(width, tmp_path):
    """Journals refuse fonts of type 3."""
    for font in ("", "serif"):
        figure = one_figure(
            "tracking", "", [Drawn("run", loop_table())], look=Look(width, font, 8.0)
        )
        figure.savefig(tmp_path / "a.pdf")
        figure.savefig(tmp_path / "a.svg")
        fonts = (tmp_path / "a.pdf").read_bytes()
        assert b"/CIDFontType2" in fonts and b"/Type3" not in fonts
        assert "tracking errors</text>" in (tmp_path / "a.svg").read_text(encoding="utf-8")
        if pdffonts := which("pdffonts"):
            listed = subprocess.run(
                [pdffonts, tmp_path / "a.pdf"], capture_output=True, text=True, check=True
            ).stdout.splitlines()[2:]
            assert listed and all(
                " CID TrueType " in line and " yes yes " in line for line in listed
            )


def test_a_look_is_applied_over_the_projects_style(tmp_path):
    """Width, font and size have precedence over the style."""
    file = tmp_path / "mine.mplstyle"
    file.write_text("figure.figsize: 5, 4\nfont.size: 9\nlines.linewidth: 3", encoding="utf-8")
    run = [Drawn("run", loop_table())]
    figure = plot(run, ["plant.eta.x"], look=Look(style=file))
    [axes] = figure.axes
    assert (figure.get_figwidth(), axes.yaxis.label.get_fontsize()) == (5.0, 9.0)
    assert axes.get_lines()[0].get_linewidth() == 3.0
    again = plot(run, ["plant.eta.x"], look=Look(3.5, "serif", 8.0, {"figure.figsize": (5, 4)}))
    [label] = [axes.yaxis.label for axes in again.axes]
    assert (again.get_figwidth(), label.get_fontsize(), label.get_family()) == (3.5, 8.0, ["serif"])


@pytest.mark.parametrize(
    ("look", "text"),
    [
        (Look(width=0.1), "width 0.1: must be from 2 to 40 in"),
        (Look(size=float("nan")), "size nan: must be from 4 to 40 pt"),
        (Look(font="DejaVu Sanz"), "font 'DejaVu Sanz' is not installed; did you mean DejaVu Sans"),
        (Look(style="none.mplstyle"), "style none.mplstyle: no such file"),
        (Look(style={"figure.figsze": 3}), "style: .*'figure.figsze' is not a valid"),
    ],
)
def test_a_look_that_there_is_not_is_refused(look, text):
    with pytest.raises(InputError, match=text):
        plot([Drawn("run", loop_table())], ["plant.eta.x"], look=look)


def test_a_mistake_in_the_file_of_a_style_is_refused(tmp_path):
    file = tmp_path / "mine.mplstyle"
    file.write_text("lines.linewidth: 3\nfigure.figsze: 5, 4\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"style: Bad key figure.figsze in file .*, line 2"):
        plot([Drawn("run", loop_table())], ["plant.eta.x"], look=Look(style=file))


def test_users_may_take_the_style():
    """It has the colours of the figures."""
    with plt.style.context("auv_fmu.figures"):
        assert plt.rcParams["pdf.fonttype"] == plt.rcParams["ps.fonttype"] == 42
        assert plt.rcParams["axes.prop_cycle"].by_key()["color"] == list(COLOURS)


# Events


def with_events(*occurrences):
    """A closed loop of 8 s with events."""
    table = loop_table()
    return Table.of(table.header, table.rows, Ending(events=tuple(occurrences)))


def numbers_in(axes):
    return [text for text in axes.texts if text.get_text().isdecimal()]


def test_events_have_numbers_in_the_panels_and_their_names_below_the_figure():
    table = with_events(
        Occurrence(2.0, "drop plant.y", "no position", 0),
        Occurrence(4.00000001, "drop plant.y, ended", event=0),
        Occurrence(5.0, "stop", "power lost", 1),
    )
    figure, _ = compose("", FIGURES["comparison"][""], [Drawn("run", table)])
    assert figure.get_supxlabel() == "1: no position, 2 to 4 s; 2: power lost, 5 s"
    first = panel(figure, "$e_x$ [m]")
    assert [text.get_text() for text in numbers_in(first)] == ["1", "2"]
    assert not numbers_in(panel(figure, "$e_y$ [m]"))
    marked = {line.get_xdata()[0] for line in panel(figure, "$e_y$ [m]").get_lines()[1:]}
    assert marked == {2.0, 4.00000001, 5.0}


def test_events_leave_the_axes_as_they_are():
    table = with_events(Occurrence(2.0, "stop", "power lost", 1))
    limits = [
        panel(compose("", FIGURES["comparison"][""], [Drawn("run", shown)])[0], "$e_x$ [m]")
        for shown in (table, loop_table())
    ]
    assert limits[0].get_ylim() == limits[1].get_ylim()


def test_the_list_of_events_names_the_runs_if_times_differ():
    early = with_events(Occurrence(2.0, "a", "fault"), Occurrence(3.0, "b", "gust"))
    late = with_events(Occurrence(2.5, "a", "fault"), Occurrence(3.0, "b", "gust"))
    runs = [Drawn("proposed", early), Drawn("PD", late), Drawn("third", early)]
    figure, _ = compose("", FIGURES["comparison"][""], runs)
    assert figure.get_supxlabel() == (
        "1: fault, 2 s (proposed), 2.5 s (PD), 2 s (third); 2: gust, 3 s"
    )


def test_numbers_of_events_do_not_overlap():
    table = with_events(*(Occurrence(4.0 + 0.01 * i, f"{i}", f"event {i}") for i in range(5)))
    figure, _ = compose("", FIGURES["comparison"][""], [Drawn("run", table)])
    save(figure, *())
    boxes = [text.get_window_extent() for text in numbers_in(panel(figure, "$e_x$ [m]"))]
    assert len(boxes) == 5
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_an_event_has_its_own_end_if_another_text_begins_alike():
    """The first event does not end."""
    events = [
        Occurrence(1.0, "freeze a.u", "for ever", 0),
        Occurrence(2.0, "freeze a.u, a.v", "both", 1),
        Occurrence(3.0, "freeze a.u, a.v, ended", event=1),
        Occurrence(3.5, "override a.u = 1", "one", 2),
        Occurrence(4.0, "override a.u = 10", "ten", 3),
        Occurrence(5.0, "override a.u = 10, ended", event=3),
        Occurrence(6.0, "override a.u = 1, ended", event=2),
        *(Occurrence(6.0 + 0.01 * i, "pulse", "pulse", 4) for i in range(20)),
        Occurrence(7.0, "pulse, ended", event=4),
    ]
    figure, _ = compose("", FIGURES["comparison"][""], [Drawn("run", with_events(*events))])
    label = figure.get_supxlabel().replace("\n", " ")
    assert label.startswith(
        "1: for ever, 1 s; 2: both, 2 to 3 s; 3: one, 3.5 to 6 s; 4: ten, 4 to 5 s; "
        "5: pulse, 6 to 7 s"
    )
