"""The readings of `docs/readings.md` in short: the report must stand alone."""

from __future__ import annotations

import re

#: By number: the heading of the point, and what it decides.
READINGS: dict[int, tuple[str, str]] = {
    1: (
        "The plant has six degrees of freedom.",
        "The controller is derived on five; the plant has roll too, which does not stay zero, with "
        "a righting moment that is not given: ours is that of pitch, 5 N·m.",
    ),
    2: (
        "The vertical.",
        "The kinematics (1) have a pole at a pitch of 90 degrees, which Figs. 5 and 6 reach: the "
        "plant integrates a quaternion.",
    ),
    3: (
        "The Jacobian of a vehicle that rolls.",
        "(11) is written for zero roll; the controller takes the whole attitude. "
        "`printed_jacobian` restores (11) as printed.",
    ),
    4: (
        "The observer.",
        "(24) contradicts its initial values; the second derivative form (51) is integrated, from "
        "the initial values as printed.",
    ),
    5: (
        "Order of evaluation.",
        "At t_k everything is evaluated, then all states advance by 20 ms: no delay in the loop.",
    ),
    6: (
        "(59) is not what was tabulated.",
        "The printed efforts have the size of (59) without 1/T_f under the root, the L2 norm of "
        "the applied signals; both are computed.",
    ),
    7: (
        "Not given at all:",
        "the level of the noise, the end times, the initial roll, and for which controller "
        "eps_t = 10 goes in Fig. 5. What is used is ours.",
    ),
    8: (
        "(56):",
        "sign(k) is the sign of the velocity in direction k, and sign(0) = 0; tau_w enters (2) "
        "with a minus.",
    ),
    9: (
        "nu in Tanh(nu rho r / eps_t)",
        "is the constant 0.2785 of Lemma 2, no velocity.",
    ),
    10: (
        "Gain conditions.",
        "As printed, the paper's gains violate (30), and any gains (31); the paper's do so in any "
        "unit of speed: Theorem 1 does not apply to this loop. Remark 4 calls the conditions "
        "sufficient and conservative.",
    ),
    11: (
        "Turning radius.",
        "With the printed parameters (2) turns on a radius of 0.28 m, not 0.6 m, which is its "
        "diameter; nothing was changed to meet it.",
    ),
    12: (
        "The acceleration of the reference",
        "follows in closed form from the planner's state, without differences of samples.",
    ),
    13: (
        "What results are held against:",
        "every number and claim of section 4, in this report.",
    ),
    14: (
        "P2.3 does not hold with C_2 as printed.",
        "No C_2 has both P2.2 and P2.3. The proof uses P2.3 in (20) and (28), and can do without; "
        "the controller is not affected.",
    ),
    15: (
        "Two signals named almost alike.",
        "dy_o of (18) and the state with a hat of (23) and (24) differ by k_d z; the control law "
        "(21) takes the first.",
    ),
    16: (
        "The direction of z.",
        "(1) and (2) are the same with z down and with z up. The words of section 4.1, where a "
        "helix descends from z = -2 m, have z up: so the paper's figures are drawn. Our ports are "
        "north, east and down.",
    ),
}

#: Mentions outside headings.
_MENTION = re.compile(r"(?<!# )\b[Rr]eadings? \d+(?:(?:, | to | and )\d+)*")


def linked(text: str) -> str:
    """Markdown in which every mention of a reading leads to its section."""

    def link(number: re.Match[str]) -> str:
        known = int(number[0]) in READINGS
        return f"[{number[0]}](#reading-{number[0]})" if known else number[0]

    return _MENTION.sub(lambda mention: re.sub(r"\d+", link, mention[0]), text)


def section() -> str:
    """The readings in Markdown, a heading each."""
    return "\n\n".join(
        f"#### Reading {number}\n\n**{heading}** {decision}"
        for number, (heading, decision) in READINGS.items()
    )
