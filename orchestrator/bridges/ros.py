"""A ROS 2 node that steps a system, each step with the commands that answer its odometry.

`python -m orchestrator.bridges.ros fig4` publishes `/clock` and `odom` (nav_msgs/Odometry, the true
state of the vehicle), and takes `wrench` (geometry_msgs/WrenchStamped): the wrench with the stamp
of the odometry answers it. Each of several vehicles has its own topics, such as `auv1/odom`.
:mod:`.frames` converts all of them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

from orchestrator.bridges import frames
from orchestrator.cosim import PortName, RealTime, System
from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import load_scenario
from orchestrator.simulation.simulation import Simulation, SimulationFailed
from orchestrator.vehicle.signals import Loop, loops_of

try:
    import rclpy
    from builtin_interfaces.msg import Time
    from geometry_msgs.msg import WrenchStamped
    from nav_msgs.msg import Odometry
    from rclpy.duration import Duration
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.node import Node
    from rclpy.utilities import remove_ros_args
    from rosgraph_msgs.msg import Clock
except ImportError as error:
    raise ImportError(
        f"{error}: source a ROS 2 installation, or pip install 'auv-fmu[ros]'"
    ) from error

#: Most messages that wait, on each topic.
_DEPTH = 10

#: Time after which the first odometry is published again, for controllers that came late [s].
_PATIENCE = 1.0

#: Exit statuses, as of `auv-fmu`.
_OK, _FAILED, _BAD_INPUT, _INTERRUPTED = 0, 1, 2, 130


class Lockstep:
    """A node that steps a system, each step with the commands that answer its odometry.

    Until the first command of a vehicle has come, its own controller commands it.

    Attributes:
        simulation: of the system.
        node: of ROS.

    """

    def __init__(
        self,
        system: str | Path | Mapping[str, Any] | System,
        parameters: Mapping[str, Any] | None = None,
        *,
        stop_time: float | None = None,
        step: float | None = None,
        real_time: float | None = None,
        timeout: float | None = None,
        keep: bool = True,
    ) -> None:
        """Load a system, and make the node; call `rclpy.init` before.

        Args:
            system, parameters, stop_time, step, keep: as for :class:`Simulation`.
            real_time: simulated seconds per second at most; None: as fast as commands come.
            timeout: longest wait for commands [s], after which the last ones stay; None: for ever.

        Raises:
            ValueError: a name or a value is not usable, or there is no vehicle.

        """
        if real_time is not None:
            RealTime.check(real_time)
        loaded = system if isinstance(system, System) else load_scenario(system)[1]
        loops = loops_of(loaded)
        for name in (name for loop in loops for name in _needs(loop)):
            if not loaded.has(PortName.read(name)):
                raise InputError(f"{loaded.name}: has no {name}, which a node needs")
        self.simulation = Simulation(system, parameters, stop_time=stop_time, step=step, keep=keep)
        self._real_time = real_time or inf
        self._timeout = inf if timeout is None else timeout
        self.node = rclpy.create_node("auv_fmu")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._clock = self.node.create_publisher(Clock, "/clock", _DEPTH)
        self._vehicles = [
            _Vehicle(self.node, loop, f"{loop.name}/" if len(loops) > 1 else "") for loop in loops
        ]

    def run(self) -> None:
        """Make all steps, and publish the last state.

        Raises:
            SimulationFailed: a component fails.
            ExternalShutdownException: of rclpy, after Ctrl-C.

        """
        simulation = self.simulation
        step = simulation.step_size
        end = inf if simulation.stop_time is None else simulation.stop_time
        began = monotonic() - simulation.time / self._real_time
        while (left := (end - simulation.time) / step) > 1e-9:
            next_time = simulation.time + min(left, 1.0) * step
            self._listen(self._publish(), began + next_time / self._real_time)
            for vehicle in self._vehicles:
                vehicle.command(simulation)
            if left >= 1.0 - 1e-9:
                simulation.step()
            else:
                simulation.run()
        self._publish()
        for vehicle in self._vehicles:
            vehicle.publisher.wait_for_all_acked(Duration(seconds=_PATIENCE))

    def _publish(self) -> Time:
        """Publish the time and all states; return the stamp."""
        seconds, nanoseconds = divmod(round(self.simulation.time * 1e9), 1_000_000_000)
        stamp = Time(sec=seconds, nanosec=nanoseconds)
        self._clock.publish(Clock(clock=stamp))
        for vehicle in self._vehicles:
            vehicle.publish(self.simulation, stamp)
        return stamp

    def _listen(self, stamp: Time, due: float) -> None:
        """Take commands until the next step is due, and all answer a stamp or are late."""
        latest, again = monotonic() + self._timeout, monotonic() + _PATIENCE
        is_first_look = True
        while True:
            now = monotonic()
            waiting = [vehicle for vehicle in self._vehicles if not vehicle.answers(stamp)]
            until = max(due, latest) if waiting else due
            if until <= now and not is_first_look:
                return
            if again <= now:
                for vehicle in waiting:
                    if vehicle.wrench is None:
                        vehicle.publish(self.simulation, stamp)
                again = now + _PATIENCE
            self._executor.spin_once(timeout_sec=max(min(until, again) - now, 0.0))
            is_first_look = False

    def close(self) -> None:
        """Free the simulation and the node."""
        self.simulation.close()
        self._executor.shutdown()
        self.node.destroy_node()


class _Vehicle:
    """The topics of a vehicle.

    Attributes:
        publisher: of its odometry.
        wrench: the latest one; None: there was none yet.

    """

    def __init__(self, node: Node, loop: Loop, prefix: str) -> None:
        self._loop = loop
        self.wrench: WrenchStamped | None = None
        self._odometry = Odometry()
        self._odometry.header.frame_id = "map"
        self._odometry.child_frame_id = f"{prefix}base_link"
        self.publisher = node.create_publisher(Odometry, f"{prefix}odom", _DEPTH)
        node.create_subscription(WrenchStamped, f"{prefix}wrench", self._take, _DEPTH)

    def _take(self, wrench: WrenchStamped) -> None:
        self.wrench = wrench

    def answers(self, stamp: Time) -> bool:
        """Tell whether the latest wrench answers the odometry with a stamp."""
        return self.wrench is not None and self.wrench.header.stamp == stamp

    def publish(self, simulation: Simulation, stamp: Time) -> None:
        """Publish the state."""
        x, y, z, phi, theta, psi = simulation[f"{self._loop.vehicle}.eta"].tolist()
        u, v, w, p, q, r = simulation[f"{self._loop.vehicle}.nu"].tolist()
        self._odometry.header.stamp = stamp
        pose, twist = self._odometry.pose.pose, self._odometry.twist.twist
        position, turn = pose.position, pose.orientation
        position.x, position.y, position.z = frames.earth((x, y, z))
        turn.w, turn.x, turn.y, turn.z = frames.attitude(phi, theta, psi)
        twist.linear.x, twist.linear.y, twist.linear.z = frames.body((u, v, w))
        twist.angular.x, twist.angular.y, twist.angular.z = frames.body((p, q, r))
        self.publisher.publish(self._odometry)

    def command(self, simulation: Simulation) -> None:
        """Override the commands with the latest wrench, if there is one."""
        if self.wrench is not None:
            force, moment = self.wrench.wrench.force, self.wrench.wrench.torque
            u, _, _ = frames.body((force.x, force.y, force.z))
            _, q, r = frames.body((moment.x, moment.y, moment.z))
            for name, value in zip(self._loop.commanded, (u, q, r), strict=True):
                simulation[name] = value


def _needs(loop: Loop) -> tuple[str, ...]:
    """Return the signals of a vehicle that a node needs."""
    return (*loop.commanded, *loop.posture, *loop.nu)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node, and return the exit status.

    Args:
        arguments: of the command line; None: those of the process.

    """
    parser = argparse.ArgumentParser("python -m orchestrator.bridges.ros", description=__doc__)
    parser.add_argument("system", metavar="SCENARIO|FILE", help="system, as of `auv-fmu run`")
    parser.add_argument(
        "--set", action="append", default=[], metavar="COMPONENT.PARAMETER=VALUE",
        help="set a parameter; may be repeated",
    )  # fmt: skip
    for flag, unit, text in (
        ("--stop-time", "S", "end of the run [s]; default: the scenario's"),
        ("--step", "S", "communication step [s]; default: the scenario's"),
        ("--real-time", "FACTOR", "limit the speed to FACTOR times real time"),
        (
            "--timeout",
            "S",
            "longest wait for commands [s], then the last ones stay; default: none",
        ),
    ):
        parser.add_argument(flag, type=float, metavar=unit, help=text)
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for the result")
    given = sys.argv[1:] if arguments is None else list(arguments)
    options = parser.parse_args(remove_ros_args(given))
    try:
        rclpy.init(args=given)
        _run(options)
    except InputError as error:
        parser.exit(_BAD_INPUT, f"{parser.prog}: error: {error}\n")
    except SimulationFailed as error:
        print(error, file=sys.stderr)
        return _FAILED
    except (KeyboardInterrupt, ExternalShutdownException):
        return _INTERRUPTED
    finally:
        rclpy.try_shutdown()
    return _OK


def _run(options: argparse.Namespace) -> None:
    """Run a node, and write its result."""
    parameters = {}
    for text in options.set:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--set {text}: write COMPONENT.PARAMETER=VALUE")
        parameters[name.strip()] = value.strip()
    with closing(
        Lockstep(
            options.system,
            parameters,
            stop_time=options.stop_time,
            step=options.step,
            real_time=options.real_time,
            timeout=options.timeout,
            keep=options.out is not None,
        )
    ) as lockstep:
        try:
            lockstep.run()
        finally:
            if options.out is not None:
                lockstep.simulation.result().save(options.out)


if __name__ == "__main__":
    sys.exit(main())
