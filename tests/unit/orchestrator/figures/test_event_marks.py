"""Events are marked in the panels, and named below the figure."""

from __future__ import annotations

from orchestrator.cosim import Ending, Occurrence, Table
from orchestrator.figures.drawing import compose, save
from orchestrator.figures.run_figures import FIGURES
from orchestrator.figures.style import Drawn
from support.tables import loop_table


def panel(figure, label):
    """The axes whose vertical axis has a label."""
    [axes] = [axes for axes in figure.axes if axes.get_ylabel() == label]
    return axes


def with_events(*occurrences):
    """A closed loop of 8 s in which something has happened."""
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
        panel(compose("", FIGURES["comparison"][""], [Drawn("run", one)])[0], "$e_x$ [m]")
        for one in (table, loop_table())
    ]
    assert limits[0].get_ylim() == limits[1].get_ylim()


def test_the_list_of_events_says_in_which_run_they_were():
    early = with_events(Occurrence(2.0, "a", "fault"), Occurrence(3.0, "b", "gust"))
    late = with_events(Occurrence(2.5, "a", "fault"), Occurrence(3.0, "b", "gust"))
    runs = [Drawn("proposed", early), Drawn("PD", late), Drawn("third", early)]
    figure, _ = compose("", FIGURES["comparison"][""], runs)
    assert figure.get_supxlabel() == (
        "1: fault, 2 s (proposed), 2.5 s (PD), 2 s (third); 2: gust, 3 s"
    )


def test_numbers_of_events_do_not_lie_upon_each_other():
    table = with_events(*(Occurrence(4.0 + 0.01 * i, f"{i}", f"event {i}") for i in range(5)))
    figure, _ = compose("", FIGURES["comparison"][""], [Drawn("run", table)])
    save(figure, *())
    boxes = [text.get_window_extent() for text in numbers_in(panel(figure, "$e_x$ [m]"))]
    assert len(boxes) == 5
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_an_event_has_its_own_end_whatever_the_texts_begin_with():
    """One lasts to the end of the run; those of the others begin with its text."""
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
    said = figure.get_supxlabel().replace("\n", " ")
    assert said.startswith(
        "1: for ever, 1 s; 2: both, 2 to 3 s; 3: one, 3.5 to 6 s; 4: ten, 4 to 5 s; "
        "5: pulse, 6 to 7 s"
    )
