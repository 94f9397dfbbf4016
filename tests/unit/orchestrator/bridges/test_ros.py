"""The node and a controller, as two processes, and the numbers of steps by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auv_fmu import Simulation, read, simulate
from orchestrator.machine.compilers import machines_compiler
from support.ros import beside, run_node

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

from orchestrator.bridges.ros import main

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler"),
]

#: Axes of ROS, in the paper's.
EARTH, BODY = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1, -1, -1])
ANGLES = ("psi", "theta", "phi")

CONTROLLER = str(Path(__file__).parents[3] / "support" / "ros_controller.py")


@pytest.mark.parametrize(
    ("scenario", "stop_time", "names"),
    [
        # The last step is half as long.
        ("fig4", 2.01, {"": ""}),
        ("formation-v", 1.0, {f"auv{k}/": f"auv{k}." for k in (1, 2, 3)}),
    ],
)
def test_a_controller_in_another_process_gives_the_numbers_of_steps_by_hand(
    scenario, stop_time, names, tmp_path
):
    with beside(CONTROLLER, str(stop_time), *names) as controller:
        run_node(scenario, "--stop-time", str(stop_time), "--out", str(tmp_path))
        lines, _ = controller.communicate(timeout=60)
    with Simulation(scenario, stop_time=stop_time) as sim:
        while sim.time < stop_time - 1e-9:
            for name in names.values():
                north, east, down = sim[f"{name}plant.eta"][:3]
                u, _, _, _, q, r = sim[f"{name}plant.nu"]
                sim[f"{name}plant.tau.u"] = 0.5 * east - 4.0 * u
                sim[f"{name}plant.tau.q"] = 0.25 * down - 3.0 * q
                sim[f"{name}plant.tau.r"] = -0.125 * north - 2.0 * r
            if sim.time + 0.02 < stop_time + 1e-9:
                sim.step()
            else:
                sim.run()
        alone = sim.result()
    result = read(tmp_path)
    assert result.columns == alone.columns
    np.testing.assert_array_equal(result.rows, alone.rows)
    # Turned by the matrices of both pairs of axes.
    axes = {
        name: EARTH
        @ Rotation.from_euler(
            "ZYX", alone.group(*(f"{name}plant.eta.{k}" for k in ANGLES))
        ).as_matrix()
        @ BODY
        for name in names.values()
    }
    assert len(lines.splitlines()) >= len(alone) * len(names)
    for line in lines.splitlines():
        time, *turn, earth, body = line.split()
        prefix = body.removesuffix("base_link")
        row = np.abs(alone.time - float(time)).argmin()
        assert alone.time[row] == pytest.approx(float(time), abs=1e-9) and earth == "map"
        seen = Rotation.from_quat([float(number) for number in turn]).as_matrix()
        np.testing.assert_allclose(seen, axes[names[prefix]][row], rtol=0, atol=1e-12)


def test_without_an_answer_in_time_the_scenarios_own_controller_acts(tmp_path):
    apart = ("--ros-args", "-r", "__ns:=/boat")
    run_node("fig4", "--stop-time", "1", "--timeout", "0", "--out", str(tmp_path), *apart)
    expected = simulate("fig4", stop_time=1.0)
    np.testing.assert_array_equal(read(tmp_path).rows, expected.rows)


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [(["fig4", "--set", "plant"], "--set plant"), (["fig4", "--real-time", "0"], "real time x 0")],
)
def test_wrong_arguments_are_refused_in_a_line(arguments, culprit, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert culprit in capsys.readouterr().err
