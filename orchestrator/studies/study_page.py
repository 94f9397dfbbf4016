"""The page on studies, from what declares them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from string import Template

from orchestrator.figures.style import printed_unit
from orchestrator.runs.entries import Entry
from orchestrator.runs.scenario_page import table
from orchestrator.studies import figure_entries as figures
from orchestrator.studies.study import ENTRIES, read_study, ready_studies
from orchestrator.vehicle.indices import INDICES

_FILES = (
    ("`runs.parquet`", "a row a run: what varied, the indices, why it failed"),
    ("`study.json`", "the study, the command, versions; how many runs there are, how many failed"),
    ("`FIGURE.png`, `.svg`", "the figures that the study asks for"),
)

_COLUMNS = (
    (
        "`run`",
        "its number, from 0: of the combinations the last value under `vary` changes fastest; the "
        "samples of a combination follow each other, and so do the scenarios of a point",
    ),
    ("`scenario`", "which one, if there are several"),
    ("`component.parameter`, `step`", "what varied"),
    *(
        (
            f"`{index.columns[0]}`"
            + "".join(f" `{name.removeprefix(index.name)}`" for name in index.columns[1:]),
            index.meaning.replace("|", r"\|")
            + (f" [{printed_unit(index.unit)}]" * bool(index.unit)),
        )
        for index in INDICES
    ),
    ("`failure`", "why it ended early; empty if it did not"),
)

_ENGINES = (
    (
        "runs",
        "any scenario, SSP or FMU of one's own",
        "the standard closed loop, with either controller",
    ),
    (
        "made of",
        "the FMUs, `--kind python` or `native`, which travel with the study",
        "the equations, [compiled by numba](batch.md)",
    ),
    ("numbers", "those of `auv-fmu run`", "the same, bit for bit"),
)

_PAGE = Template("""\
# Studies

A study is many runs, of which each differs from the others in what the study varies: a grid, lists,
random samples, over any parameter of any component. It needs some packages more:

    pip install '.[studies]'
    auv-fmu sweep STUDY.toml|NAME [--engine fmu|batch] [--kind python|native]
                [--loop auto|python|compiled] [--scheduler ADDRESS] [--workers N] [--out DIR]

The runs are made side by side in processes of this machine, as many as it has cores, or by the
workers of [a Dask cluster](cluster.md). What comes out goes into `results/NAME/`, or DIR:

$files

Until all runs are done, they are kept in `unfinished.sqlite` beside `study.json`, each with a
checksum. What was changed is refused in a line that names the file; `--force`, or `force` of
`sweep`, moves the study aside and begins anew.

- **The same command goes on.** However a study was ended, by Ctrl-C, a crash or `kill -9`: what was
  done is not done again, no run is lost or there twice, and the table is that of a study that was
  never ended. A study that is done is only drawn again. Another study, or the same one after a
  change of anything that decides its numbers, in its scenarios, their FMUs, the equations or the
  versions of what runs them, is refused in one line: it needs another folder.
- **The number of a run fixes what it is**, for good: the samples follow from method and seed.
- **A run that fails is a row**, with `failure` and without indices, and never the end of a study.
  So is a run whose FMU ends the process that makes it.

## Ready studies

$ready

Each is 10,000 runs or more of the proposed controller against PD:
[what they show](ready-studies.md).

## A study file

```toml
title = "How near the limits"
scenario = ["fig5", "fig5-pd"]
stop_time = 60.0

[parameters]
plant.noise.std = 0.0

[vary]
planner.eta0.z = { from = -2.0, to = -30.0, n = 8 }
controller.saturation = ["tanh", "algebraic"]

[sample]
method = "sobol"
n = 64
seed = 1

[sample.range]
plant.eta0.theta = [-1.5, 1.5]
controller.eps_t = { from = 0.1, to = 100.0, spacing = "log" }

[figures.peaks]
kind = "bands"
x = "planner.eta0.z"
show = ["peak_command.u", "late_error"]
```

These are 8 · 2 · 64 points, each of which is run with both scenarios: the proposed controller and
PD. A parameter that only one of them has, as `controller.saturation`, is set where it is.

$entries

A range under `vary` or `sample.range` may go either way. Of whole numbers, such as
`plant.noise.seed`, `sample.range` draws each with the same chance; what is no number can be listed
under `vary` alone. Of `n` samples of method `sobol` the first 2, 4, 8 ... are spread evenly
themselves; `n` should be a power of two. `latin-hypercube` is even in each value alone, for any
`n`; `random` is independent draws.

A file with any other entry, a value that does not exist or cannot be what it shall be, is refused
in one line before the first run.

## What comes out of a run

$columns

Here e is y - y_d with the true control point. What a system has no ports for, and what is never
reached, is empty. Where a system has several vehicles, the columns of each begin with its name:
`auv1.l2_effort.u`.

From Python, with the same options:

```python
from orchestrator import sweep

result = sweep(
    {
        "scenario": "fig5",
        "stop_time": 5.0,
        "vary": {"plant.eta0.y": [0.0, 1.0, 2.0], "controller.saturation": ["tanh", "algebraic"]},
    },
    kind="native",
    out="results/mine",
)
print(result.runs, result.failed, list(result)[:4])
print(result["plant.eta0.y"], result["failure"])
```

The first argument is the name of a ready study, the path of a file, or what such a file holds.
`result[column]` is a numpy array, `result.to_dataframe()` a DataFrame of pandas. In a script, what
calls `sweep` stands behind `if __name__ == "__main__":`, because processes are started that import
the script.

## Who makes the runs

$engines

A study says which with `engine`; the command line wins. Where many runs begin that another engine
or kind would make sooner, with the same numbers, a line names its option.

## Figures

`[figures.NAME]` draws `NAME.png` and `NAME.svg`. A study without any draws what moves what.

$figures

Besides columns, a figure can show the largest of a group (`peak_command`), a norm
(`|final_error.x, final_error.y|`), a product (`a * b`), and the shares of runs that
`failed`, that were `lost`, and that `saturated`. `[figures.labels]` gives columns names.
""")


def study_page() -> str:
    """The page, in Markdown."""
    ready = ((f"`{name}`", read_study(name).title) for name in ready_studies())
    return _PAGE.substitute(
        ready=table(("`auv-fmu sweep`", "what it asks"), ready),
        files=table(("file", "what it holds"), _FILES),
        columns=table(("column", "meaning"), _COLUMNS),
        engines=table(("", "`--engine fmu`", "`--engine batch`"), _ENGINES),
        entries=table(("entry", "value", "meaning", "without it"), _rows(ENTRIES)),
        figures=table(("entry", "value", "meaning", "without it"), _rows(figures.ENTRIES)),
    )


def _rows(entries: Mapping[str, Entry]) -> Iterator[tuple[str, ...]]:
    for name, entry in entries.items():
        yield f"`{name}`", entry.kind, entry.meaning.replace("|", r"\|"), entry.default
