"""When a run begins and ends, and the steps that it asks for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp.archive import Archive
from orchestrator.formats.ssp.hierarchy import Leaf

#: Elements and attributes of annotations that hold the step of a whole system: those of libcosim
#: and ecos, of Vico, and of OMSimulator.
_STEPS = (
    ("FixedStepAlgorithm", "baseStepSize"),
    ("FixedStepMaster", "baseStepSize"),
    ("FixedStepMaster", "stepSize"),
    ("SimulationInformation", "fixedStepSize"),
)

#: That of a component.
_STEP_OF_A_COMPONENT = ("StepSizeHint", "value")


class Times(NamedTuple):
    """The experiment of a description [s]; None: it does not say."""

    start_time: float | None
    stop_time: float | None
    step: float | None


def times_of(archive: Archive, root: Element) -> Times:
    """The experiment that a description asks for."""
    experiment = root.find("DefaultExperiment")
    stated = (
        archive.number(element, attribute, None)
        for name, attribute in _STEPS
        for place in (experiment, root.find("System"), root)
        for element in annotated(place, name)
    )
    return Times(
        archive.number(experiment, "startTime", None),
        archive.number(experiment, "stopTime", None),
        next((step for step in stated if step is not None), None),
    )


def step_of(archive: Archive, leaf: Leaf) -> float | None:
    """The step that a component asks for [s]; None, as zero does: it has no wish."""
    name, attribute = _STEP_OF_A_COMPONENT
    for element in annotated(leaf.content, name):
        return archive.number(element, attribute, None) or None
    return None


def annotated(element: Element | None, name: str) -> Iterator[Element]:
    """Elements of a name in the annotations of an element itself."""
    if element is not None:
        for annotations in element.findall("Annotations"):
            yield from annotations.iter(name)
