"""Each example as both kinds of FMU, built as users do: valid, equal, and verified by itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.util import read_csv
from fmpy.validation import validate_fmu

from fmus.discovery import REFERENCE
from fmus.kinds import FMI_VERSIONS, KINDS, NATIVE
from fmus.ports.port import FAULT
from fmus.trial import run
from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from orchestrator.machine.disk import hold_lock
from orchestrator.runs.own_components import build_own
from reference import example_span, write_component_reference
from support.derivatives import check
from support.examples import EXAMPLES, NAMES, load
from support.tiers import slow

#: Together they have all types of ports, noise, matrices, a delay, and no state.
QUICK = ("kalman_filter", "lag_with_delay", "resistor", "state_machine", "waypoint_guidance")

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

each = pytest.mark.parametrize("name", [*QUICK, *slow(*(n for n in NAMES if n not in QUICK))])


@pytest.fixture(scope="session")
def fmu(shared: Path) -> Callable[..., Path]:
    """Build an example's FMU, unless another test has done so."""

    def built(name: str, kind: str, fmi: str = "2") -> Path:
        folder = shared / "examples" / f"{kind}{fmi}" / name
        folder.mkdir(parents=True, exist_ok=True)
        with hold_lock(folder, wait=True):
            done = [*folder.glob("fmu/*.fmu")]
            return (
                done[0] if done else build_own(EXAMPLES / name, folder / "fmu", kind=kind, fmi=fmi)
            )

    return built


def outputs(path: Path) -> list[str]:
    """Names of the outputs of an FMU, without `fault`."""
    variables = fmpy.read_model_description(str(path)).modelVariables
    names = [variable.name for variable in variables if variable.causality == "output"]
    return [name for name in names if name != FAULT.name]


def rows(path: Path, **settings: float) -> Any:
    """Outputs of an FMU over time, as fmpy runs it."""
    return fmpy.simulate_fmu(str(path), output=outputs(path), **settings)


@each
def test_both_kinds_are_valid_and_give_the_bits_of_plain_python(fmu, name: str):
    # A binary fraction: fmpy takes a step as the difference of two times, which is then the same.
    step, stop_time, module = 2.0**-6, 20.0, load(name)
    plain = run(module, stop_time=stop_time, step=step)
    for kind in KINDS:
        assert validate_fmu(str(fmu(name, kind))) == []
        found = rows(fmu(name, kind), stop_time=stop_time, output_interval=step)
        for port in outputs(fmu(name, kind)):
            column = np.array(plain[port], found[port].dtype)
            if getattr(module, "SAMPLED", False):
                # fmpy reads what is held after a step: the sample of its beginning.
                column = np.append(column[:1], column[:-1])
            # Not by ==, to which both zeros are equal.
            assert column.tobytes() == found[port].tobytes(), (kind, port)


@each
@pytest.mark.parametrize("fmi", FMI_VERSIONS)
def test_derivatives_equal_differences(fmu, tmp_path: Path, name: str, fmi: str):
    check(fmu(name, NATIVE, fmi), tmp_path, share=0.4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["state_machine", "waypoint_guidance"])
def test_fmi3_is_valid_and_gives_the_same_bits(fmu, name: str):
    path = fmu(name, NATIVE, "3")
    assert validate_fmu(str(path)) == []
    older, newer = (rows(file) for file in (fmu(name, NATIVE), path))
    for port in outputs(fmu(name, NATIVE)):
        # Enumerations have 64 bits in FMI 3.0.
        found = newer[port].astype(older[port].dtype)
        assert (found == newer[port]).all() and found.tobytes() == older[port].tobytes(), port


@pytest.mark.parametrize("kind", KINDS)
def test_fmu_agrees_with_the_results_that_it_carries(fmu, capsys, kind: str):
    assert main(["verify", str(fmu("kalman_filter", kind))]) == 0
    assert "1 of 1 experiments with results agree" in capsys.readouterr().out


@each
def test_committed_reference_is_what_the_tool_writes(fmu, tmp_path: Path, name: str):
    """To 1e-9: mathematical functions of two machines may differ in the last place."""
    written = write_component_reference(
        fmu(name, NATIVE), tmp_path, example_span(fmu(name, NATIVE))
    )
    committed = EXAMPLES / name / REFERENCE
    assert {path.name for path in written} == {path.name for path in committed.iterdir()}
    for path in written:
        if path.suffix != ".csv":
            assert path.read_bytes() == (committed / path.name).read_bytes()
            continue
        ours, theirs = read_csv(path), read_csv(committed / path.name)
        assert ours.dtype == theirs.dtype
        for port in theirs.dtype.names:
            np.testing.assert_allclose(ours[port], theirs[port], rtol=1e-9, atol=1e-9)


def test_references_are_small():
    sizes = [path.stat().st_size for path in EXAMPLES.glob(f"*/{REFERENCE}/*")]
    assert len(sizes) >= 5 * len(NAMES)
    assert sum(sizes) < 600_000
