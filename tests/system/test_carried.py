"""Reference results inside FMUs, of the project and of FMUs that are written here."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from math import exp
from pathlib import Path
from zipfile import ZipFile

import pytest

from fmus.discovery import REFERENCE, components, source_of
from orchestrator.commands.main import main
from support import others, typed
from support.linear import linear
from support.texts import mentions, numbers_in, tells

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"

#: A manifest as in the draft, version 1.0.0-beta.1.
MANIFEST = """\
<?xml version="1.0" encoding="UTF-8"?>
<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"
    fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="1.0.0-beta.1"
    fmi-ls:fmi-ls-description="Layered Standard providing information on related files.">
  <Related type="application/x-ma-hs-experiments" source="tests/smoke.exp" role="experiment"/>
  <Related type="application/x-ssp-parameter-set" source="lag.ssv" role="parameter">
    <Label name="variant:lag"/>
  </Related>
  <Related type="text/plain" source="note.txt" role="document"/>
</fmiReferences>
"""
EXPERIMENTS = """\
<?xml version="1.0" encoding="UTF-8"?>
<Experiments name="Smoke">
  <Experiment name="step" description="A lag" startTime="0.0" stopTime="1.0" stepSize="0.1">
    <Parameters source="lag.ssv"/>
    <Stimuli source="in.csv"/>
    <References source="out.csv"/>
  </Experiment>
</Experiments>
"""

#: T x' = u - x, with T = 0.5 and x(0) = 1, as parameters of `support/linear.c`.
PARAMETERS = """\
<?xml version="1.0" encoding="UTF-8"?>
<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    version="1.0" name="lag">
  <ssv:Parameters>
    <ssv:Parameter name="A00"><ssv:Real value="-2.0"/></ssv:Parameter>
    <ssv:Parameter name="B00"><ssv:Real value="2.0"/></ssv:Parameter>
    <ssv:Parameter name="C00"><ssv:Real value="1.0"/></ssv:Parameter>
    <ssv:Parameter name="x0"><ssv:Real value="1.0"/></ssv:Parameter>
  </ssv:Parameters>
</ssv:ParameterSet>
"""


def lag(n: int = 10, h: float = 0.1) -> list[float]:
    """The lag's output; its input is the time at the beginning of each step, and held in it."""
    x = [1.0]
    for k in range(n):
        x.append(k * h + (x[-1] - k * h) * exp(-2.0 * h))
    return x


def table(values: list[float], h: float = 0.1) -> str:
    rows = "".join(f"{k * h!r},{value!r}\n" for k, value in enumerate(values))
    return f"time,y0\n{rows}"


FILES = {
    "fmi-ls-manifest.xml": MANIFEST,
    "tests/smoke.exp": EXPERIMENTS,
    # The address is relative to the file of experiments in one draft, to the manifest in another.
    "lag.ssv": PARAMETERS,
    "tests/in.csv": "time,u0\n0,0\n1,1\n",
    "tests/out.csv": table(lag()),
}


def carrying(fmu: Path, files: Mapping[str, str | None]) -> str:
    """Copy an FMU, add files, and return the name of the copy."""
    path = shutil.copyfile(fmu, fmu.with_name("lag.fmu"))
    with ZipFile(path, "a") as archive:
        for name, text in files.items():
            if text is not None:
                archive.writestr(f"{FOLDER}/{name}", text)
    return str(path)


def test_results_that_are_right_are_certified(tmp_path: Path, capsys):
    """One output of two, in eleven rows, from the exponential function."""
    assert main(["verify", carrying(linear(tmp_path), FILES)]) == 0
    head, verdict, last = capsys.readouterr().out.splitlines()
    assert head == "lag.fmu: FMI-LS-REF 1.0.0-beta.1"
    assert verdict.startswith("step: 1 output ")
    numbers = numbers_in(verdict.removeprefix("step: "))
    assert numbers[:4] == [1, 11, 0, 1]
    assert numbers[4] < 1e-15
    assert numbers[5] == 1e-6
    assert verdict.endswith(": y1")
    assert tells(last, (1, 1))


def test_results_that_lie_are_found(tmp_path: Path, capsys):
    values = lag()
    values[5] += 1e-3
    files = {**FILES, "tests/out.csv": table(values)}
    fmu = carrying(linear(tmp_path), files)
    assert main(["verify", fmu]) == 2
    out, err = capsys.readouterr()
    assert "y0 differs first, at t = 0.5 s" in out
    assert tells(err, (0, 1))
    assert main(["verify", fmu, "--tolerance", "1.1e-3"]) == 0
    assert "0.0011 (--tolerance)" in capsys.readouterr().out
    assert main(["verify", fmu, "--tolerance", "0.9e-3"]) == 2


@pytest.mark.parametrize(("tolerance", "status"), [("0.0011", 0), ("0.0009", 2), ("0", 2)])
def test_tolerance_of_the_experiment_counts(tmp_path: Path, tolerance: str, status: int, capsys):
    values = lag()
    values[5] += 1e-3
    stated = EXPERIMENTS.replace('stepSize="0.1"', f'stepSize="0.1" tolerance="{tolerance}"')
    files = {**FILES, "tests/out.csv": table(values), "tests/smoke.exp": stated}
    assert main(["verify", carrying(linear(tmp_path), files)]) == status
    assert ("(the experiment's)" in capsys.readouterr().out) == (status == 0)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        # A later draft has the times in the element of the kind.
        (
            ' startTime="0.0" stopTime="1.0" stepSize="0.1">',
            '><TransientSimulation startTime="0.0" stopTime="1.0" stepSize="0.1"/>',
        ),
        # The step follows from the results.
        ('stopTime="1.0" stepSize="0.1"', ""),
    ],
)
def test_other_forms_of_an_experiment_are_read(tmp_path: Path, old: str, new: str):
    files = {**FILES, **changed("tests/smoke.exp", old, new)}
    assert main(["verify", carrying(linear(tmp_path), files)]) == 0


def test_rows_between_steps_and_at_other_times(tmp_path: Path, capsys):
    """Between two rows lies their mean; of two rows of one time the first counts."""
    x = lag()
    rows = (
        f"time,y0,other\n0,{x[0]},1\n0.25,{(x[2] + x[3]) / 2},1\n0.3,{x[3]},1\n0.3,9,1\n1.5,9,1\n"
    )
    assert main(["verify", carrying(linear(tmp_path), {**FILES, "tests/out.csv": rows})]) == 0
    out, err = capsys.readouterr()
    assert tells(out, (3, 0, 0.3, 1))
    assert "other" in err


def test_result_without_an_experiment_belongs_to_the_description(tmp_path: Path, capsys):
    """As in the Reference FMUs: x' = 0 from x(0) = 0 until the stop time."""
    manifest = MANIFEST.replace("tests/smoke.exp", "out.csv").replace('"experiment"', '"result"')
    files = {"fmi-ls-manifest.xml": manifest, "out.csv": "time,y0\n0,0\n2,0\n4,0\n"}
    assert main(["verify", carrying(linear(tmp_path), files)]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("out.csv: 1 output ")


def test_experiments_are_judged_one_by_one(tmp_path: Path, capsys):
    experiment = EXPERIMENTS[EXPERIMENTS.index("<Experiment ") : -len("</Experiments>\n")]
    more = experiment.replace('"step"', '"wrong"').replace("out.csv", "wrong.csv")
    none = '<Experiment name="none"/>'
    text = EXPERIMENTS.replace("</Experiments>", f"{more}{none}</Experiments>")
    wrong = table([*lag()[:-1], 0.0])
    files = {**FILES, "tests/smoke.exp": text, "tests/wrong.csv": wrong}
    assert main(["verify", carrying(linear(tmp_path), files)]) == 2
    out, err = capsys.readouterr()
    lines = dict(line.split(": ", 1) for line in out.splitlines())
    assert "agree" in lines["step"]
    assert "at t = 1 s" in lines["wrong"]
    assert "no results" in lines["none"]
    assert tells(err, (1, 2))


@pytest.mark.parametrize(
    ("column", "wrong"), [("mode_y", "calm"), ("fault", "false"), ("heard", "end"), ("y", "6.1")]
)
def test_other_types_are_equal_or_not(tmp_path: Path, column: str, wrong: str):
    """Inputs hold between two rows, and reach the outputs a step later, except for the String."""
    fmu = others.build(tmp_path)
    gain = PARAMETERS[: PARAMETERS.index("<ssv:Parameter name")] + (
        '<ssv:Parameter name="gain"><ssv:Real value="3.0"/></ssv:Parameter>'
        "</ssv:Parameters></ssv:ParameterSet>"
    )
    rows = {
        "time": ["0.5", "0.7"],
        "mode_y": ["calm", "4"],
        "fault": ["false", "True"],
        "heard": ["start", "start"],
        "y": ["6", "6"],
    }

    def result() -> str:
        lines = [*rows.keys()], *zip(*rows.values(), strict=True)
        return "\n".join(map(",".join, lines))

    files = {
        **FILES,
        "lag.ssv": gain,
        "tests/in.csv": "time,u,mode,on\n0,2,calm,false\n0.55,2,storm,true\n",
        "tests/out.csv": result(),
    }
    assert main(["verify", carrying(fmu, files)]) == 0
    rows[column][1] = wrong
    assert main(["verify", carrying(fmu, {**files, "tests/out.csv": result()})]) == 2


@pytest.mark.parametrize(("array", "integer"), [("1.5 3.1", 3), ("1.5 3", 2), ("1.5", 3)])
def test_arrays_and_integers_of_fmi_3(tmp_path: Path, array: str, integer: int):
    """M v = w, with M = (1 2 3, 4 5 6) and v = (0, 0, 1/2); no double equals 2^53 + 3."""

    def files(array: str, integer: int) -> dict[str, str | None]:
        held = 2**53 + integer
        value = f'name="u_Int64"><ssv:Integer value="{2**53 + 3}"/>'
        start = PARAMETERS[: PARAMETERS.index('name="A00"')]
        rows = "".join(f"{time},{array},{held}\n" for time in (0, 0.1))
        return {
            **FILES,
            "lag.ssv": f"{start}{value}</ssv:Parameter></ssv:Parameters></ssv:ParameterSet>",
            "tests/in.csv": "time,u_Float64\n0,0\n",
            "tests/out.csv": f"time,w,y_Int64\n{rows}",
        }

    fmu = typed.build(tmp_path)
    assert main(["verify", carrying(fmu, files("1.5 3", 3))]) == 0
    assert main(["verify", carrying(fmu, files(array, integer))]) == 2


def changed(file: str, old: str, new: str) -> dict[str, str]:
    text = FILES[file]
    assert old in text
    return {file: text.replace(old, new)}


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        ({"fmi-ls-manifest.xml": None}, f"lag.fmu {FOLDER}/fmi-ls-manifest.xml"),
        ({"fmi-ls-manifest.xml": "<fmiReferences"}, "fmi-ls-manifest.xml well-formed"),
        ({"fmi-ls-manifest.xml": "<fmiReferences/>"}, "no results"),
        (
            {"fmi-ls-manifest.xml": '<!DOCTYPE a [<!ENTITY b "c">]><fmiReferences/>'},
            "fmi-ls-manifest.xml DOCTYPE",
        ),
        (changed("fmi-ls-manifest.xml", "tests/smoke", "smoke"), "'smoke.exp'"),
        ({"tests/smoke.exp": "<Experiments/>"}, "tests/smoke.exp no experiment"),
        ({"lag.ssv": None}, "step 'lag.ssv'"),
        ({"tests/out.csv": "time,z\n0,1\n"}, "none of the columns"),
        ({"tests/out.csv": "time,y0\n0,nan\n"}, "out.csv 2, y0: 'nan'"),
        ({"tests/out.csv": "time,y0\n7,0\n"}, "no row"),
        ({"tests/out.csv": "time,y0,lag.y0\n0,0,0\n"}, "two columns"),
        ({"tests/in.csv": "time,u9\n0,0\n"}, "no inputs"),
        ({"tests/in.csv": "time,u0\n0,0\n1\n"}, "in.csv 3"),
        (changed("tests/smoke.exp", '"out.csv"', '"../../../modelDescription.csv"'), "modelDesc"),
        (changed("tests/smoke.exp", '"out.csv"', '"../../../../secret.csv"'), "secret.csv"),
        (changed("tests/smoke.exp", '"out.csv"', '"https://a.example/b.csv"'), "is not in the FMU"),
        (
            changed("tests/smoke.exp", '"out.csv"', '"o.h5" type="application/hdf5"'),
            "hdf5 text/csv",
        ),
        (changed("tests/smoke.exp", "<Parameters", "<SteadyState/><Parameters"), "SteadyState"),
        (changed("tests/smoke.exp", '"1.0"', '"one"'), "stopTime 'one'"),
        (changed("tests/smoke.exp", 'stepSize="0.1"', 'tolerance="1"'), "tolerance 1"),
        (changed("lag.ssv", '"-2.0"', '"two"'), "A00 two"),
    ],
)
def test_an_fmu_that_cannot_be_verified_is_refused(tmp_path: Path, files, reason: str, capsys):
    assert main(["verify", carrying(linear(tmp_path), {**FILES, **files})]) == 2
    out, err = capsys.readouterr()
    assert mentions(out + err, reason)
    *warnings, refusal = err.splitlines()
    assert all("warning: " in line for line in warnings)
    assert "lag.fmu: " in refusal
    for line in (*out.splitlines(), *warnings):
        assert tempfile.gettempdir() not in line


def test_flaws_that_change_nothing_are_warnings(tmp_path: Path, capsys):
    unknown = '<ssv:Parameter name="D99"><ssv:Real value="1.0"/></ssv:Parameter></ssv:Parameters>'
    files = {
        **FILES,
        **changed("fmi-ls-manifest.xml", "org.fmi-standard.fmi-ls-ref", "org.other"),
        **changed("lag.ssv", "</ssv:Parameters>", unknown),
        "tests/in.csv": "time,u0,z\n0,0,0\n1,1,1\n",
    }
    assert main(["verify", carrying(linear(tmp_path), files)]) == 0
    err = capsys.readouterr().err
    assert mentions(err, "org.other D99 inputs z")
    assert err.count("warning") == 3


def test_all_outputs_without_a_result_are_named_if_asked(tmp_path: Path, capsys):
    files = {
        **FILES,
        "tests/smoke.exp": EXPERIMENTS.replace('<Parameters source="lag.ssv"/>', ""),
        "tests/in.csv": "time,u_Float64\n0,0\n",
        "tests/out.csv": "time,y_Float64\n0,0\n",
    }
    fmu = carrying(typed.build(tmp_path), files)
    assert main(["verify", fmu]) == 0
    output = capsys.readouterr().out
    assert mentions(output, "21, w[1] --verbose") and "y_String" not in output
    assert main(["verify", fmu, "--verbose"]) == 0
    output = capsys.readouterr().out
    assert mentions(output, "y_Float32 y_String") and "--verbose" not in output


@pytest.mark.parametrize("option", ["--scenario=fig5", "--step=0.1"])
def test_option_of_tables_is_refused(tmp_path: Path, refused, option: str):
    fmu = carrying(linear(tmp_path), FILES)
    assert option.partition("=")[0] in refused("verify", fmu, option)


@pytest.mark.parametrize(
    ("kind", "name"),
    [("dist", "AuvPlant"), ("native", "AuvPlant"), *(("dist3", name) for name in components())],
)
def test_our_fmus_prove_themselves(request: pytest.FixtureRequest, kind: str, name: str, capsys):
    assert main(["verify", str(request.getfixturevalue(kind) / f"{name}.fmu")]) == 0
    verdicts = [line for line in capsys.readouterr().out.splitlines() if " outputs agree " in line]
    folder = source_of(name).folder / REFERENCE
    assert len(verdicts) == 1 + len([*folder.glob("*.ssv")])
    for verdict in verdicts:
        assert tells(verdict, (21, 0, 4)) and verdict.endswith(": fault")
        *_, worst, tolerance = numbers_in(verdict)
        assert tolerance == 1e-9
        assert worst <= 1e-9
