"""FMUs with features of other tools: run with the right numbers, or refused by name."""

from __future__ import annotations

import csv
import ctypes
import platform
import re
from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest

from orchestrator import read
from orchestrator.commands.main import main
from orchestrator.cosim import (
    Connection,
    Linear,
    PortName,
    System,
    read_component,
    write_ssp,
)
from orchestrator.machine.errors import Findings, InputError
from orchestrator.runs.result import read_result
from orchestrator.runs.scenario import Inputs, read_inputs
from support.others import WAYS, build, run, system_of
from support.texts import mentions, tells

EVERY_WAY = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
HERE = pytest.mark.parametrize(
    "way", [WAYS["python"], WAYS["compiled"]], ids=["python", "compiled"]
)


def with_values(system, values):
    return system.with_parameters({PortName("a", port): value for port, value in values.items()})


@EVERY_WAY
def test_parameters_last_also_where_initialisation_resets_them(tmp_path, way):
    system = with_values(system_of(build(tmp_path, "RESETS")), {"gain": 3.0, "u": 2.0})
    table = run(system, **way)
    assert (table["a.y"] == 6.0).all()
    assert table.parameters[PortName("a", "gain")] == 3.0
    assert table.ending.messages == ()


@EVERY_WAY
def test_a_parameter_that_did_not_take_is_said_before_all_messages(tmp_path, way):
    system = with_values(system_of(build(tmp_path, "CHATTERS")), {"stubborn": 3.0, "gain": 2.0})
    first, *others = run(system, **way).ending.messages
    assert tells(first, (3, 1)) and "a.stubborn" in first
    assert others[0] == "a: chatter 0"
    assert len(others) >= 100


@EVERY_WAY
def test_an_input_that_nothing_feeds_keeps_what_the_fmu_begins_with(tmp_path, way):
    """The description has no start value; the FMU begins with 101325.

    It also lacks a function that none of its capabilities needs.
    """
    table = run(system_of(build(tmp_path, "LACKS")), **way)
    assert (table["a.u"] == 101325.0).all()
    assert (table["a.y"] == 101325.0).all()
    assert (table["a.mode"] == 1.0).all()


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_files_keep_texts_and_numbers(workplace, form):
    """Also where a text has commas, quotes and lines of its own."""
    text = 'one, "two"\nthree'
    [archive] = write_ssp(with_values(system_of(build(workplace)), {"said": text}), workplace)
    if form == "parquet":
        pytest.importorskip("pyarrow", reason="needs the extra `parquet`")
    command = f"run {archive} --stop-time 0.3 --step 0.1 --no-figures --out r --format {form}"
    assert main(command.split()) == 0
    if form == "csv":
        with Path("r", "result.csv").open(newline="", encoding="utf-8") as file:
            names, *rows = csv.reader(file)
        assert [row[names.index("a.heard")] for row in rows] == [text] * 4
    _, table, *_ = read_result(Path("r"))
    assert (table["a.y"] == 101325.0).all()
    assert "a.heard" not in table
    assert read(Path("r"))["a.heard"].tolist() == [text] * 4


@EVERY_WAY
def test_texts_that_change_in_every_step_arrive(tmp_path, way):
    """Each of two FMUs outputs its number of steps and its input, which is the other's last output.

    At first each holds the start value of its description.
    """
    wires = {"a.said": "b.heard", "b.said": "a.heard"}
    table = run(system_of(build(tmp_path, "SPEAKS"), "ab", wires), **way)
    assert table["a.heard"].tolist()[:4] == ["start", "a1 start", "a2 b1 start", "a3 b2 a1 start"]
    assert table["b.heard"].tolist()[:4] == ["start", "b1 start", "b2 a1 start", "b3 a2 b1 start"]


@HERE
def test_an_alarming_message_of_a_call_that_went_well_ends_nothing(tmp_path, way):
    """Nor does an output that happens to be called fault."""
    system = with_values(system_of(build(tmp_path, "CHATTERS")), {"on": True})
    table = run(system, **way)
    assert table.failure is None
    assert (table["a.fault"] == 1.0).all()
    assert len(table) == 11


@pytest.mark.parametrize("way", [way for name, way in WAYS.items() if name != "compiled"])
def test_a_second_instance_of_an_fmu_that_allows_one_gets_its_own_process(tmp_path, way):
    """Also in the next run of this process."""
    fmu = build(
        tmp_path,
        "ONCE",
        'canBeInstantiatedOnlyOncePerProcess="true" canHandleVariableCommunicationStepSize="true"',
    )
    system = with_values(system_of(fmu, "abc", {"b.u": "a.y", "c.u": "b.y"}), {"u": 2.0})
    for _ in range(2):
        table = run(system, **way)
        assert table.failure is None
        assert (table["c.y"][2:] == 2.0).all()


@HERE
def test_nothing_is_left_in_a_library_of_the_run_before(tmp_path, way):
    """Each instance of a library has a larger gain than the one before."""
    system = with_values(system_of(build(tmp_path, "REMEMBERS")), {"u": 2.0})
    for _ in range(3):
        assert (run(system, **way)["a.y"] == 2.0).all()


@HERE
def test_a_last_step_that_rounding_takes_beyond_the_stop_time_is_made(tmp_path, way):
    """In doubles 0.2 + 0.1 > 0.3, and the FMU makes no step beyond its stop time."""
    table = run(system_of(build(tmp_path)), 0.3, 0.1, **way)
    assert table.failure is None
    assert table.time[-1] == 3 * 0.1


def test_the_compiled_loop_gives_way_to_fmus_in_their_own_processes(tmp_path):
    fmu = build(tmp_path, "ONCE", 'canBeInstantiatedOnlyOncePerProcess="true"')
    table = run(system_of(fmu, "ab"), loop="compiled")
    assert table.header.loop == "python"
    assert any(mentions(text, "b: process") for text in table.ending.messages)


@HERE
def test_an_fmu_that_takes_steps_of_one_length_gets_no_other(tmp_path, way):
    system = system_of(build(tmp_path, "RIGID", ""))
    table = run(system, 1.0, 0.3, **way)
    assert table.failure is None
    assert table.time.tolist() == [0.0, 0.3, 0.6, 3 * 0.3]
    [message] = table.ending.messages
    assert mentions(message, "a: t = 0.9 s")
    assert run(system, 0.9, 0.3, **way).ending.messages == ()
    with pytest.raises(InputError, match="a: "):
        run(system, 0.2, 0.3, **way)


@EVERY_WAY
def test_a_step_that_continues_after_its_call_is_waited_for(tmp_path, way):
    fmu = build(
        tmp_path,
        "WAITS",
        'canRunAsynchronuously="true" canHandleVariableCommunicationStepSize="true"',
    )
    table = run(system_of(fmu), **way)
    assert table.failure is None
    assert len(table) == 11
    # Without that capability it should have ended with its call.
    assert mentions(run(system_of(build(tmp_path, "WAITS")), **way).failure, "a: doStep")


def test_a_description_that_is_not_valid_is_a_note_where_it_does_no_harm(tmp_path):
    findings = Findings()
    read_component("a", build(tmp_path), findings=findings)
    [note] = findings.notes
    assert mentions(note, 'a: plain.fmu "u" (line 2)')


@pytest.mark.parametrize("way", [WAYS["python"], WAYS["isolated"]])
def test_a_machine_for_which_there_is_no_library_is_named(tmp_path: Path, capsys, way):
    fmu = build(tmp_path, platform="win64")
    with pytest.raises(InputError) as error:
        run(system_of(fmu), **way)
    assert mentions(str(error.value), "a: plain.fmu others.so linux64 win64")
    assert main(["check", str(fmu)]) == 2
    assert mentions(capsys.readouterr().out, "others.so linux64 win64")


@pytest.mark.parametrize("folder", ["aarch64-linux", "linux64"])
def test_a_library_for_arm_may_have_the_standards_name_or_the_one_of_x86(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
):
    """FMI 2.0.4 has a name for ARM; fmpy and OpenModelica have the other."""
    monkeypatch.setattr(fmpy, "platform_tuple", "aarch64-linux")
    fmu = build(tmp_path, platform=folder)
    if folder != fmpy.platform:
        with ZipFile(fmu, "a") as archive:
            archive.writestr("binaries/linux64/others.so", "for x86-64")
    assert len(run(system_of(fmu))) == 11


@pytest.mark.parametrize("way", [WAYS["python"], WAYS["isolated"]])
@pytest.mark.parametrize(
    ("name", "share"), [("others.so", 0.02), ("others.so", 0.999), ("another.so", 1.0)]
)
def test_a_library_cut_short_or_renamed_is_refused(tmp_path, capsys, name, share, way):
    """Before it is loaded: the system would end a process that reads what is not there."""
    cut = tmp_path / "cut.fmu"
    with ZipFile(build(tmp_path)) as fmu, ZipFile(cut, "w") as archive:
        for file in fmu.namelist():
            content = fmu.read(file)
            whole = len(content) if file.endswith(".xml") else int(share * len(content))
            archive.writestr(file.replace("others.so", name), content[:whole])
    with pytest.raises(InputError, match=rf"a: .*{re.escape(name)}"):
        run(system_of(cut), **way)
    if share < 1.0:
        assert main(["check", str(cut)]) == 2
        assert name in capsys.readouterr().out


def test_an_fmu_that_cannot_be_instantiated_says_that_it_needs_a_tool(tmp_path):
    fmu = build(tmp_path, "ONCE", 'needsExecutionTool="true"')
    with pytest.raises(InputError) as error:
        run(system_of(fmu, "ab"))
    assert mentions(str(error.value), "b: ONCE.fmu instantiated tool")


@EVERY_WAY
def test_a_mode_that_an_fmu_takes_on_is_its_own(tmp_path, way):
    """It rounds upward and flushes to zero from the moment that it is loaded."""
    changing, plain = build(tmp_path, "CHANGES_MODE"), build(tmp_path)
    systems = [
        System(
            "mode",
            {"a": read_component("a", fmu), "b": read_component("b", plain)},
            (Connection(PortName("a", "y"), PortName("b", "u"), Linear(1e-300, 5e-310)),),
            {PortName("a", "u"): 0.1, PortName("b", "gain"): 1e-10},
        )
        for fmu in (changing, plain)
    ]
    found, expected = (run(system, 10.0, 0.1, **way) for system in systems)
    assert found.rows.tobytes() == expected.rows.tobytes()
    assert 0.0 < found["b.y"][-1] < 1e-309
    assert np.array_equal(found.time, np.arange(101) * 0.1)
    assert [0.1 + tiny for tiny in (1e-300, -1e-300)] == [0.1, 0.1]


def test_the_mode_of_who_simulates_is_left_as_it_was(tmp_path):
    c, upward = ctypes.CDLL(None), 0x800
    if platform.machine() != "x86_64":
        pytest.skip("the number of the floating-point mode is that of x86-64")
    system = system_of(build(tmp_path))
    expected = run(system)
    c.fesetround(upward)
    try:
        found = run(system)
        assert c.fegetround() == upward
    finally:
        c.fesetround(0)
    assert found.rows.tobytes() == expected.rows.tobytes()


@pytest.mark.parametrize(
    ("text", "instead", "words"),
    [
        ('factor="1000"', 'factor="1_000"', "factor .*<BaseUnit> .*'1_000'"),
        ('m="1"', 'm="\N{ARABIC-INDIC DIGIT ONE}"', "m of <BaseUnit> is '.'"),
        ('name="storm" value="4"', 'name="storm" value="4_0"', "value of <Item> is '4_0'"),
        ('<Real start="1"/>', '<Real start="1" min="much"/>', "min of <Real> is 'much'"),
        ('valueReference="4"', 'valueReference="0_4"', "valueReference of <ScalarVariable>"),
        ('name="storm" value="4"', 'name="storm"', "<Item> .*value"),
        ('name="storm" value="4"', 'name="storm" value="1.5"', "value of <Item> .*'1.5'"),
    ],
)
def test_numbers_of_descriptions_that_others_do_not_read_are_refused(
    tmp_path, text, instead, words
):
    units = (
        '<UnitDefinitions><Unit name="km"><BaseUnit m="1" factor="1000"/></Unit></UnitDefinitions>'
    )
    rest = "<TypeDefinitions>"
    change = (rest, units.replace(text, instead) + rest)
    if text not in units:
        change = text, instead
    with pytest.raises(InputError, match=words):
        read_component("a", build(tmp_path, change=change))


def test_annotations_of_tools_are_not_read_as_numbers(tmp_path):
    """Also if the description is invalid elsewhere."""
    tool = '<Annotations><Tool name="t"><Item value="1_0" min="low"/></Tool></Annotations>'
    change = '<Real start="1"/>', f'<Real start="1" odd="1"/>{tool}'
    assert read_component("a", build(tmp_path, change=change)).variables["gain"].start == "1"


def test_no_description_makes_integers_longer(tmp_path):
    change = (
        'name="count" valueReference="4" causality="parameter" variability="fixed">\n  <Integer'
    )
    wide = build(tmp_path, change=(change, f'{change} min="-1e10" max="1e10"'))
    with pytest.raises(InputError, match=r"a\.count = 2147483648: .*2147483647"):
        with_values(system_of(wide), {"count": 2**31})
    with pytest.raises(InputError, match=r"a\.count = -2147483649"):
        with_values(system_of(wide), {"count": -(2**31) - 1})
    assert with_values(system_of(wide), {"count": -(2**31)})


@EVERY_WAY
@pytest.mark.parametrize("variability", ["continuous", "discrete"])
def test_real_inputs_follow_a_table_as_their_variability_says(tmp_path, variability, way):
    """As with fmpy, which interpolates what is continuous and holds what is discrete."""
    change = (
        '"0" causality="input"><Real',
        f'"0" causality="input" variability="{variability}"><Real',
    )
    fmu = build(tmp_path, change=change)
    rows = [(0.0, 0.0), (0.4, 1.0), (0.75, 3.0)]
    file = tmp_path / "inputs.csv"
    file.write_text("time,a.u\n" + "".join(f"{t},{u}\n" for t, u in rows))
    system, [input_table] = read_inputs([Inputs(file)], system_of(fmu), ())
    table = run(system, hooks=[input_table.playback()], **way)
    inputs = np.array(rows, dtype=[("time", float), ("u", float)])
    theirs = fmpy.simulate_fmu(
        str(fmu), stop_time=1.0, output_interval=0.1, input=inputs, output=["y"], validate=False
    )
    # Its last step may be as short as a rounding error.
    np.testing.assert_allclose(table["a.y"][1:], theirs["y"][1 : len(table)], atol=1e-12)
    assert set(table["a.y"]) <= {0.0, 1.0, 3.0} or variability == "continuous"


# FMUs that end the run by themselves

_FEEDTHROUGH = ('<Unknown index="2" dependencies=""/>', '<Unknown index="2" dependencies="1"/>')


def ring(folder, ends, steps=()):
    """Three FMUs in a ring, in which the outputs of the first two feed through.

    Each integrates 1 + u; the outputs of the first two are the integral plus u / 2.
    """
    components = {}
    for name, end in zip("abc", ends, strict=True):
        own = folder / f"{name}{end:g}"
        own.mkdir()
        fmu = build(own, f"ENDS_AT={end}", change=_FEEDTHROUGH if name != "c" else ("", ""))
        components[name] = read_component(name, fmu)
    wires = tuple(
        Connection(PortName(source, "y"), PortName(target, "u"))
        for source, target in ("ab", "bc", "ca")
    )
    gain = {PortName(name, "gain"): 0.5 * (name != "c") for name in "abc"}
    return System("ends", components, wires, gain, steps=dict(steps))


@EVERY_WAY
@pytest.mark.parametrize(
    ("order", "who", "at", "rows"),
    [
        ("feedthrough", "b", 0.45, 5),
        ("gauss-seidel", "a", 0.5, 5),
        ("jacobi", "c", 0.5, 5),
        ("jacobi", "b", 0.02, 1),
    ],
)
def test_the_rows_before_an_fmu_ends_are_kept(tmp_path, way, order, who, at, rows):
    table = run(
        ring(tmp_path, [at if name == who else 100.0 for name in "abc"]), order=order, **way
    )
    whole = run(ring(tmp_path, [101.0] * 3), order=order)
    assert table.failure is None
    assert mentions(table.ending.remark, f"t = {0.1 * (rows - 1):g} s: {who} {at:g} s")
    assert len(whole) == 11
    assert table.rows.tobytes() == whole.rows[:rows].tobytes()


@EVERY_WAY
def test_a_step_of_a_slow_fmu_that_ends_in_it_counts_from_its_beginning(tmp_path, way):
    table = run(ring(tmp_path, [0.75, 100.0, 100.0], {"a": 0.4}), **way)
    assert table.failure is None
    assert mentions(table.ending.remark, "a 0.75 s")
    assert table.time == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
