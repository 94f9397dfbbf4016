"""The tables of docs/reference/examples.md, for `tools/pages.py`."""

from __future__ import annotations

import ast
from pathlib import Path

from orchestrator.paper.page import table

#: The folder with the examples.
EXAMPLES = Path(__file__).parents[2] / "examples"

#: The examples by their groups, and what of the language each shows.
GROUPS = {
    "controllers": {
        "lqr": "sampled, no state, `derive` of parameters",
        "pid": "sampled, tunable parameters, `check`",
        "waypoint_guidance": "matrix as parameter, `derive`, internal steps",
    },
    "estimators": {
        "complementary_filter": "`atan2`, several inputs, exact step",
        "extended_kalman_filter": "sampled, `solve`, refusal, `replaced`",
        "kalman_filter": "sampled, matrices as state, `derive`",
        "luenberger_observer": "vectors, Runge-Kutta, internal steps",
        "notch_filter": "sampled, filter memory, sampling period",
    },
    "plants": {
        "battery": "`interpolate`, `derive`, `feedthrough=()`",
        "cart_pendulum": "`solve`, Runge-Kutta, internal steps",
        "dc_motor": "vectors, Runge-Kutta, internal steps",
        "engine_map": "`interpolate`, `derive`, `feedthrough`",
        "lag_with_delay": "delay line, noise, `seed`",
        "quarter_car": "`solve`, `derive` of parameters, implicit rule",
        "rate_limiter": "`min` and `max`, tunable parameters, hysteresis",
        "water_tank": "`derive`, internal steps, Boolean output",
    },
    "logic": {
        "state_machine": "`IntEnum`, `_replace`, Boolean input",
        "thermostat": "`IntEnum` as parameter, counter, exact step",
    },
    "pythonfmu": {
        "resistor": "no state, feedthrough, tunable parameter",
        "sine_network": "constant matrix, `tanh`, no state",
        "step_response": "no state, use of `t`, formula",
    },
    "reference_fmus": {
        "bouncing_ball": "events, Boolean state, internal steps",
        "dahlquist": "internal steps, stability, exact solution",
        "stair": "Integer output, `while`, use of `t`",
        "state_space": "matrices as parameters, vector ports, internal steps",
        "van_der_pol": "internal steps, tunable parameter, Euler's rule",
    },
}


def examples() -> dict[str, str]:
    """The table of each group.

    Raises:
        ValueError: an example is in no group, or there is none of that name.

    """
    listed = [name for group in GROUPS.values() for name in group]
    if sorted(listed) != [
        p.stem for p in sorted(EXAMPLES.glob("*/*.py")) if p.stem == p.parent.name
    ]:
        raise ValueError("GROUPS and the folder of the examples differ")
    return {
        group: table(
            ("example", "what it is", "shows"),
            [(_link(name), _first_line(name), shown) for name, shown in members.items()],
        )
        for group, members in GROUPS.items()
    }


def _link(name: str) -> str:
    return f"[`{name}`](../../examples/{name}/{name}.py)"


def _first_line(name: str) -> str:
    """Of its docstring; it is not imported for that."""
    text = (EXAMPLES / name / f"{name}.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]
