"""Write reference results, with which a user checks an import into another tool.

    python tools/reference.py [FOLDER]

writes them into this repository or FOLDER. For each FMU, as in the FMI cross-check: `NAME_in.csv`
with inputs over time, `NAME_ref.csv` with the outputs, `NAME_ref.opt` with the experiment, in the
folder `reference` of its component. For the system: `reference/auv_ref.csv` and `auv_ref.opt`, from
a run in Jacobi order, like most tools. For each example: the same in `examples/NAME/reference`,
with suitable experiments of 100 steps.

The same folders have the files that the FMU contains, by the draft FMI-LS-REF:
`fmi-ls-manifest.xml`, which names the others; `experiments.exp`, by the draft MA-HS-Experiments; a
parameter set for each group of scenarios that sets parameters of the component; the results of each
experiment, in fewer rows.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import fmpy
import numpy as np
from fmpy.util import write_csv

from fmus.discovery import REFERENCE, RELATED_MANIFEST, components
from fmus.kinds import PYTHON
from fmus.ports.port import FAULT
from orchestrator.cosim import (
    Component,
    Experiment,
    Value,
    make_plan,
    read_component,
    simulate_plan,
)
from orchestrator.cosim.formats.ssp_writer import parameter_set_xml
from orchestrator.cosim.observers import CsvFile
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.own_components import build_own
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.wiring import closed_loop

#: The components that are examples.
EXAMPLES = Path(__file__).parents[1] / "examples"


class Span(NamedTuple):
    """Length of a reference run, and its step [s]."""

    stop_time: float
    step: float

    @property
    def times(self) -> np.ndarray:
        """Times of all communication points."""
        return np.arange(round(self.stop_time / self.step) + 1) * self.step


#: The reference runs of the bundle.
SPAN = Span(4.0, 0.02)
STOP_TIME, STEP = SPAN

#: Rows of the reference results of an example, at most: they span its default experiment.
ROWS = 100

#: Interval of the rows in an FMU's results, and their tolerance: mathematical functions of two
#: machines may differ in the last place.
EVERY, TOLERANCE = 10, 1e-9

#: Parameter sets by name: their scenarios, their description, and their components, if not all.
SETS: dict[str, tuple[tuple[str, ...], str, tuple[str, ...]]] = {
    "fig4": (("fig4",), "Parameters of Fig. 4 of the paper", ()),
    "fig5": (("fig5", "fig5-pd"), "Parameters of Fig. 5 of the paper", ()),
    "survey": (("path",), "Path of the survey through waypoints", ()),
    "prestero": (
        ("remus-prestero",),
        "Parameters of the REMUS by Prestero (2001)",
        ("Remus100", "Allocation"),
    ),
}

#: MIME types of files, by their endings.
_TYPES = {
    ".csv": "text/csv",
    ".exp": "application/x-ma-hs-experiments",
    ".ssv": "application/x-ssp-parameter-set",
}

#: Parameters of a path through waypoints.
_PATH = ("count", "timed", "cruise", "rounding")

#: Namespace of FMI-LS-REF, and the attributes of its manifest.
_NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
_STANDARD = {
    "name": "org.fmi-standard.fmi-ls-ref",
    "version": "1.0.0-beta.1",
    "description": ("Layered Standard providing information on related files included in an FMU."),
}


def reference_inputs(component: Component, span: Span = SPAN) -> np.ndarray:
    """Inputs that oscillate around their start values, each with its own frequency.

    A Real is a sine, small enough for the gate; a Boolean is true while that is not negative.
    """
    inputs = component.having("input")
    time = span.times
    kinds = (
        (variable.name, np.int32 if variable.type == "Boolean" else np.float64)
        for variable in inputs
    )
    table = np.zeros(len(time), dtype=[("time", np.float64), *kinds])
    table["time"] = time
    for i, variable in enumerate(inputs, start=1):
        sine = np.sin((0.5 + 0.1 * i) * (STOP_TIME / span.stop_time * time))
        if variable.type == "Boolean":
            table[variable.name] = sine >= 0.0
        else:
            start = float(component.starts[variable.name])
            table[variable.name] = start + 0.1 * (abs(start) or 1.0) * sine
    return table


def reference_outputs(
    component: Component,
    inputs: np.ndarray | None,
    values: Mapping[str, Value] | None = None,
    span: Span = SPAN,
) -> np.ndarray:
    """Outputs of a single FMU with these inputs, by fmpy.

    Args:
        component: the FMU.
        inputs: over time.
        values: of parameters; None: those of the FMU.
        span: of the run.

    """
    outputs = component.having("output")
    table: np.ndarray = fmpy.simulate_fmu(
        str(component.fmu),
        stop_time=span.stop_time,
        step_size=span.step,
        output_interval=span.step,
        start_values=dict(values or {}),
        input=inputs,
        output=[variable.name for variable in outputs if variable.name != FAULT.name],
    )
    # fmpy reads only numbers.
    kinds = [
        (name, np.int32 if kind.kind == "b" else kind)
        for name, (kind, *_) in (table.dtype.fields or {}).items()
    ]
    return table.astype(kinds)


def parameter_sets(component: Component) -> Iterator[tuple[str, dict[str, Value]]]:
    """Parameter sets of an FMU from scenarios, by name."""
    if component.description.modelName not in components():
        return
    for name, (scenarios, _, only) in SETS.items():
        if only and component.description.modelName not in only:
            continue
        values: dict[str, Value] = {}
        for scenario in scenarios:
            _, system = load_scenario(scenario)
            for place, other in system.components.items():
                if other.description.modelName == component.description.modelName:
                    # The path of a survey is its start values.
                    values |= _path(other) | system.parameters_of(place)
        if values:
            yield name, values


def _path(component: Component) -> dict[str, Value]:
    """Path of a planner with waypoints; empty for any other component."""
    starts = component.starts
    if not starts.keys() >= {*_PATH}:
        return {}
    numbers = range(1, 1 + int(starts["count"]))
    places = [f"waypoint[{number}].{axis}" for number in numbers for axis in "xyzt"]
    return {name: starts[name] for name in (*_PATH, *places)}


def write_reference(dist: Path, root: Path) -> list[Path]:
    """Write the reference results of the closed loop and of each FMU of the bundle.

    Args:
        dist: folder with the built bundle.
        root: of the repository that they are for.

    Returns:
        The files written.

    """
    written = []
    for name, module in components().items():
        folder = root.joinpath(*module.split(".")[:-1], REFERENCE)
        written += write_component_reference(dist / f"{name}.fmu", folder)
    written.append(root / REFERENCE / "auv_ref.csv")
    written[-1].parent.mkdir(exist_ok=True)
    jacobi = Experiment(STOP_TIME, STEP, "jacobi")
    plan = make_plan(closed_loop(dist), jacobi)
    simulate_plan(plan, [CsvFile(written[-1])]).require_success(plan.system.name)
    written.append(_write_options(written[-1].with_name("auv"), SPAN))
    return written


def write_examples(root: Path) -> list[Path]:
    """Write the reference results of the examples, and return the files written.

    Args:
        root: of the repository that they are for.

    """
    written = []
    with TemporaryDirectory() as temporary:
        for folder in sorted(path.parent for path in EXAMPLES.glob(f"*/{REFERENCE}")):
            # The Python kind can be built everywhere.
            fmu = build_own(folder, Path(temporary), kind=PYTHON)
            target = root / EXAMPLES.name / folder.name / REFERENCE
            written += write_component_reference(fmu, target, example_span(fmu))
    return written


def example_span(fmu: Path) -> Span:
    """Reference run of an example: its default experiment, with longer steps if necessary."""
    stated = read_component(fmu.stem, fmu).experiment
    stop_time, step = stated("stopTime"), stated("stepSize")
    assert stop_time is not None and step is not None
    return Span(stop_time, max(step, stop_time / ROWS))


def write_component_reference(fmu: Path, folder: Path, span: Span = SPAN) -> list[Path]:
    """Write the reference results of one FMU, and return the files written."""
    folder.mkdir(parents=True, exist_ok=True)
    component = read_component(fmu.stem, fmu)
    inputs = reference_inputs(component, span)
    outputs = reference_outputs(component, inputs, span=span)
    written = []
    for suffix, table in (("in", inputs), ("ref", outputs)):
        if len(table.dtype.names or ()) > 1:
            written.append(folder / f"{fmu.stem}_{suffix}.csv")
            write_csv(written[-1], table)
    written.append(_write_options(folder / fmu.stem, span))
    stimuli = written[0].name if component.having("input") else None
    return [*written, *_write_related(component, folder, stimuli, outputs, span)]


def _write_related(
    component: Component, folder: Path, stimuli: str | None, outputs: np.ndarray, span: Span
) -> Iterator[Path]:
    """Write the files that the FMU contains; yield their paths.

    Args:
        component: the FMU.
        folder: to write into.
        stimuli: name of the table of inputs there; None: there are no inputs.
        outputs: of the FMU with its own parameters.
        span: of the runs.

    """
    about = f"Experiments of {component.name} alone"
    experiments = Element("Experiments", name=component.name, description=about)
    manifest = Element(
        "fmiReferences", {f"{{{_NAMESPACE}}}fmi-ls-{key}": text for key, text in _STANDARD.items()}
    )
    _relate(manifest, "experiments.exp", "experiment/smoke-test", about)
    if stimuli is not None:
        _relate(manifest, stimuli, "other", "Inputs of the experiments over time")
    inputs = reference_inputs(component, span)
    for experiment, values in (("default", {}), *parameter_sets(component)):
        element = SubElement(
            experiments, "Experiment", name=experiment,
            description=SETS[experiment][1] if values else "Parameters as they are in the FMU",
            startTime="0.0", stopTime=str(span.stop_time), stepSize=str(span.step),
            tolerance=str(TOLERANCE),
        )  # fmt: skip
        if values:
            path = folder / f"{experiment}.ssv"
            path.write_bytes(parameter_set_xml(component, values, experiment))
            yield path
            _relate(manifest, path.name, "parameter", SETS[experiment][1])
            SubElement(element, "Parameters", source=path.name)
            outputs = reference_outputs(component, inputs, values, span)
        if stimuli is not None:
            SubElement(element, "Stimuli", source=stimuli)
        path = folder / f"{experiment}_out.csv"
        write_csv(path, outputs[::EVERY])
        yield path
        _relate(manifest, path.name, "result", f"Outputs of the experiment {experiment}")
        SubElement(element, "References", source=path.name)
    yield _write_xml(folder / "experiments.exp", experiments)
    yield _write_xml(folder / RELATED_MANIFEST, manifest)


def _relate(manifest: Element, source: str, role: str, description: str) -> None:
    stated = {"type": _TYPES[Path(source).suffix], "source": source, "role": role}
    SubElement(manifest, "Related", stated, description=description)


def _write_xml(path: Path, root: Element) -> Path:
    ElementTree.register_namespace("fmi-ls", _NAMESPACE)
    ElementTree.indent(root)
    path.write_bytes(ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n")
    return path


def _write_options(stem: Path, span: Span) -> Path:
    path = stem.with_name(f"{stem.name}_ref.opt")
    path.write_text(
        f"StartTime,0.0\nStopTime,{span.stop_time}\nStepSize,{span.step}\nRelTol,0.0\n"
        f"OutputIntervalLength,{span.step}\n",
        encoding="utf-8",
    )
    return path


def main() -> None:
    """Write the reference results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).parents[1])
    folder = parser.parse_args().folder
    for path in (*write_reference(current_fmus(), folder), *write_examples(folder)):
        print(path)


if __name__ == "__main__":
    main()
