"""The proof in numbers: Theorem 1 or 2 for given parameters; V and its margins along a run.

Certificates are computed from the true state of the vehicle, which the controller cannot measure.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.control_point import ELL as CONTROL_POINT
from auv_fmu.paper.output_feedback import Gains
from auv_fmu.paper.saturation import MAXIMUM_SLOPE, Saturation
from auv_fmu.paper.vehicle import Vehicle
from auv_fmu.proof.attraction import Theorem, theorem
from auv_fmu.proof.gain_conditions import Condition, observer_rate
from auv_fmu.proof.lyapunov import Errors, composite_errors, lyapunov
from orchestrator.cosim import Ending, Header, PortName, System, Table, TableFile
from orchestrator.machine.errors import InputError
from orchestrator.vehicle.cautions import gain_of_a_step, values_of
from orchestrator.vehicle.signals import (
    ACTUATORS,
    AXES,
    STANDARD,
    Loop,
    limits,
    loops_of,
    real_parameter,
    true_control_point,
    value_of,
    vehicle,
)

#: Remark 4 on these conditions, and what they leave open.
_NOTE = """\
The conditions are sufficient, and Remark 4 calls them conservative: a run may well be stable
where they are violated. The zetas of (26) and (29) are known from below only, by states of a level
vehicle. C_2 has a pole at the vertical, so that no finite zetas hold at all attitudes: open means
that a condition may hold for pitches that stay away from it. docs/explanation/paper.md has the
proofs, and so does the report under "What is wrong in the paper"."""

_PAPER = """\
These are the paper's own gains: as printed they violate (30), and (31) in any unit of speed."""

#: Columns of :func:`certificates`.
CERTIFICATE_COLUMNS = (
    "time",
    "V_without_theta",
    *(f"r_1.{k}" for k in AXES),
    *(f"r_2.{k}" for k in AXES),
    *(f"saturation_margin.{k}" for k in ACTUATORS),
)


def theorem_of(system: System, loop: Loop = STANDARD) -> Theorem:
    """Evaluate the theorem for the parameters of a loop.

    Raises:
        InputError: a parameter does not exist or cannot be set.

    """
    system.check()

    def value(name: str) -> Any:
        return system.value(PortName.read(name))

    def gain(name: str) -> Any:
        return value(f"{loop.controller}.{name}")

    slope = MAXIMUM_SLOPE[_saturation(gain("saturation"), f"{loop.controller}.saturation")]
    K1, K2 = (tuple(gain(f"{K}[{i}]") for i in range(1, 4)) for K in ("K1", "K2"))
    gains = Gains(K1=K1, K2=K2, lambda_=gain("lambda"), k_d=gain("k_d"), gamma=gain("gamma"))
    return theorem(vehicle(value, loop), value(loop.ell), gains, slope)


def _saturation(value: object, name: str) -> Saturation:
    """Return the saturation function with the name or number that a parameter has.

    Raises:
        InputError: there is none.

    """
    for saturation in Saturation:
        if value in (saturation.value, saturation.name.lower()):
            return saturation
    known = ", ".join(saturation.name.lower() for saturation in Saturation)
    raise InputError(f"{name} = {value}: use one of {known}")


def gain_check(system: System) -> str:
    """Return the theorem in words and numbers, for the parameters of each loop of a system.

    Raises:
        InputError: a parameter does not exist or cannot be set.

    """
    loops = loops_of(system)
    lines: list[str] = []
    for loop in loops:
        found = theorem_of(system, loop)
        if len(loops) > 1:
            lines.append(f"{loop.name}:")
        saturation = system.value(PortName.read(f"{loop.controller}.saturation"))
        number = 1 if _saturation(saturation, "") is Saturation.TANH else 2
        lines += [_verdict(found.conditions, number), "", *stated(found), "", _NOTE, ""]
        lines += _sampling(system, loop)
        if found == theorem(Vehicle(), CONTROL_POINT, Gains(), MAXIMUM_SLOPE[Saturation.TANH]):
            lines += ["", _PAPER]
        lines.append("")
    return "\n".join(lines[:-1])


def _verdict(conditions: Sequence[Condition], theorem: int) -> str:
    """Return how many of the conditions of a theorem hold; those with zetas are open at best."""
    counts = Counter(condition.verdict for condition in conditions)
    first, *others = (
        (n, f"{'is' if n == 1 else 'are'} {verdict}")
        for verdict in ("violated", "open", "met")
        if (n := counts[verdict])
    )
    parts = [f"{first[0]} of the {len(conditions)} conditions of Theorem {theorem} {first[1]}"]
    parts += [f"{n} {state}" for n, state in others]
    return f"{', '.join(parts)}: no guarantee; the loop may still be stable"


def stated(found: Theorem) -> Iterator[str]:
    """Yield lines with bounds, conditions, alphas and the region of attraction."""
    known, zetas, alphas = found.bounds, found.zetas, found.alphas
    yield "over all attitudes:"
    yield f"  lambda_m2 = {known.lambda_m2:.6g} kg, lambda_M2 = {known.lambda_M2:.6g} kg"
    yield f"  lambda_d2 = {known.lambda_d2:.6g} kg/s, lambda_D2 = {known.lambda_D2:.6g} kg/s"
    yield ""
    yield "as printed, with speeds in m/s:"
    yield f"  zeta_1 + zeta_2 >= {zetas.zeta_1_2:.4g} kg/s"
    yield f"  zeta_3 + zeta_4 >= {zetas.zeta_3_4:.4g} kg/s"
    for condition in found.conditions:
        least = f" + {condition.zetas}, at least {condition.right + condition.least:.4g}"
        yield f"  {condition.number}  {condition.statement}"
        yield (
            f"    {condition.left:.6g} > {condition.right:.6g}{least if condition.zetas else ''}: "
            f"{condition.verdict}"
        )
    if found.zeta_of_any_gains >= known.lambda_d2:
        least = f"{known.lambda_d2:.6g} > 0.5 (zeta_1 + zeta_2), at least "
        yield f"  (31), (53)  with any gains: {least}{found.zeta_of_any_gains:.4g}: violated"
    yield (
        f"  (40)  alpha_1 = {alphas.alpha_1:.4g}, alpha_2 = {alphas.alpha_2:.4g}, "
        f"alpha_3 <= {alphas.alpha_3:.4g}, alpha_4 <= {alphas.alpha_4:.4g}"
    )
    yield (
        f"  (33)  R_A lies within |vartheta| < {found.radius:.3g}"
        if found.radius
        else "  (33)  R_A is empty"
    )
    yield (
        "  (42)  with (26) required on a ball of x only: holds for "
        f"|x| < {found.x_at_most:.3g} at most, with any gains for |x| < {found.x_of_any_gains:.3g}"
    )
    yield ""
    yield "with any gains, and with speeds in any unit:"
    yield (
        f"  (31), (53)  asks for lambda < {2.0 * found.speed_of_any_gains:.3g} m/s and "
        f"|dy_d| < {found.speed_of_any_gains:.3g} m/s"
    )
    yield f"  (40)  alpha_1 < {found.alpha_1_of_any_gains:.3g} W, where (31) holds"
    yield f"  (42)  holds for |r_1| < {found.speed_of_any_gains:.3g} m/s at most"


def _sampling(system: System, loop: Loop) -> list[str]:
    """Return lines about the stability of Euler's scheme for k_d."""
    lambda_, h = (
        float(system.value(PortName.read(f"{loop.controller}.{name}")) or 0.0)
        for name in ("lambda", "h_max")
    )
    rate = observer_rate(lambda_, gain_of_a_step(values_of(system), h, loop.controller))
    return [
        f"Euler's scheme with internal steps of {h:g} s: the observer's fastest mode has the rate "
        f"{rate:.4g} 1/s,",
        f"h p = {h * rate:.3g}: it changes its sign in every step above 1, and grows above 2.",
    ]


def _columns(loop: Loop) -> tuple[str, ...]:
    """Return the columns that certificates are computed from."""
    return (
        *loop.posture, *loop.dy, *loop.seen_y_d, *loop.seen_dy_d, *loop.y_hat, *loop.dy_hat,
        *loop.z, *loop.tau,
    )  # fmt: skip


def _gains(loop: Loop) -> tuple[str, ...]:
    """Return the names of K_2, lambda and the saturation function."""
    names = ("K2[1]", "K2[2]", "K2[3]", "lambda", "saturation")
    return tuple(f"{loop.controller}.{name}" for name in names)


def certificates(table: Table, loop: Loop = STANDARD) -> np.ndarray:
    """Return a table with :data:`CERTIFICATE_COLUMNS`, a row for each instant of control.

    V is (34), or (55) for another saturation function, without its term in theta - theta_hat,
    since theta is unknown. r_1 is (17), r_2 is (19). The margin is the distance of a command from
    its nearer limit, negative outside the limits.
    """
    return _certificates(table.header, loop, table.rows[:-1], table.rows[1:])


def _certificates(header: Header, loop: Loop, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the certificates of steps, from the rows at their starts and at their ends."""
    acting = ends if header.experiment.acting_row else starts
    return np.array(list(_rows(loop, Table.of(header, starts), Table.of(header, acting))))


def _rows(loop: Loop, start: Table, acting: Table) -> Iterator[list[float]]:
    plant = vehicle(lambda name: real_parameter(start, name), loop)
    *K2_names, lambda_name, saturation = _gains(loop)
    ell, lambda_ = real_parameter(start, loop.ell), real_parameter(start, lambda_name)
    K2_x, K2_y, K2_z = (real_parameter(start, name) for name in K2_names)
    s = _saturation(value_of(start, saturation), str(saturation))
    lower, upper = limits(start, loop)

    y, dy = true_control_point(start, loop), start.group(*loop.dy)
    euler = start.group(*loop.attitude)
    y_d, dy_d, y_hat, dy_hat, z_measured, tau = (
        acting.group(*group)
        for group in (loop.seen_y_d, loop.seen_dy_d, loop.y_hat, loop.dy_hat, loop.z, loop.tau)
    )

    e, z, e_z = y - y_d, y - y_hat, y_hat - y_d
    margin = np.minimum(upper - tau, tau - lower)
    for i, t in enumerate(start.time.tolist()):
        r_1, r_2 = composite_errors(dy[i], dy_d[i], dy_hat[i], e_z[i], z_measured[i], lambda_, s)
        errors = Errors(e[i].tolist(), z[i].tolist(), r_1, r_2)
        rotation = rotation_from_euler(*euler[i].tolist())
        V = lyapunov(plant, rotation, errors, (K2_x, K2_y, K2_z), s, ell)
        yield [t, V, *r_1, *r_2, *margin[i]]


class CertificatesFile:
    """An observer that writes the certificates as CSV, if the run has the columns for them."""

    def __init__(self, path: Path, interval: float | None = None, loop: Loop = STANDARD) -> None:
        """Choose the file, which is created when the first row is written, and an interval [s]."""
        self._path, self._loop = path, loop
        self._interval = interval
        self._file: TableFile | None = None

    def begin(self, header: Header) -> None:
        """Find out if the run has the columns and parameters for certificates."""
        self._every = header.every(self._interval)
        table = Table.of(header, np.empty((0, 1 + len(header.columns))))
        loop = self._loop
        parameters = (*_gains(loop), *loop.limits, *loop.vehicle_parameters, loop.ell)
        self._is_possible = not table.missing(_columns(loop), parameters)
        columns = _columns(loop) if self._is_possible else ()
        # Keep only these columns: rows of many vehicles are long.
        self._places = [0, *(header.place[name] for name in columns)]
        self._header = replace(header, columns=columns)
        self._last = np.empty((0, len(self._places)))

    def take(self, rows: np.ndarray) -> None:
        """Write the certificates of the steps that end at these rows."""
        if not self._is_possible:
            return
        rows = np.vstack((self._last, rows[:, self._places]))
        self._last = rows[-1:]
        starts, ends = rows[:-1], rows[1:]
        if self._every is not None and len(starts):
            chosen = self._every.chosen(starts[:, 0])
            starts, ends = starts[chosen], ends[chosen]
        if len(starts):
            if self._file is None:
                self._file = TableFile.at(self._path)
                self._file.begin(Header(CERTIFICATE_COLUMNS[1:], self._header.experiment))
            self._file.take(_certificates(self._header, self._loop, starts, ends))

    def end(self, ending: Ending) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.end(ending)
