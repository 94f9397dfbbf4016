"""Speed of the bridges to PettingZoo and ROS 2: `python benchmarks/bridges.py`.

- `pettingzoo`: actions of agents in the three vehicles of formation-v, five steps each;
- `ros`: steps of fig4 with a controller in another process, which answers with zeros. A round trip
  is a step without the step of the simulation itself.

Times are wall-clock times, medians of the repetitions.
"""

from __future__ import annotations

import os
import subprocess
import sys
from statistics import median

import rclpy
from geometry_msgs.msg import WrenchStamped
from measuring import ONE, options, python, timed
from nav_msgs.msg import Odometry

from auv_fmu import Simulation
from orchestrator.bridges.pettingzoo import Formation
from orchestrator.bridges.ros import Lockstep


def answer() -> None:
    """Answer odometry until the process is ended."""
    rclpy.init()
    node = rclpy.create_node("controller")
    publisher = node.create_publisher(WrenchStamped, "wrench", 10)

    def take(odometry: Odometry) -> None:
        publisher.publish(WrenchStamped(header=odometry.header))

    node.create_subscription(Odometry, "odom", take, 10)
    rclpy.spin(node)


def pettingzoo(steps: int, repetitions: int) -> None:
    """Print the actions of agents a second."""
    env = Formation(duration=0.1 * steps)
    actions = {agent: env.action_space(agent).sample() for agent in env.possible_agents}

    def episode() -> None:
        env.reset(seed=1)
        while env.agents:
            env.step(actions)

    seconds = median(timed(episode) for _ in range(repetitions))
    n = steps * len(env.possible_agents)
    print(
        f"pettingzoo  {1e6 * seconds / steps:7.1f} us a step, {n / seconds:9,.0f} actions a second"
    )


def ros(steps: int, repetitions: int) -> None:
    """Print the time of a round trip."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    controller = subprocess.Popen([sys.executable, __file__, ONE])
    rclpy.init()
    lockstep = Lockstep("fig4", stop_time=1.0, keep=False)
    simulation = Simulation("fig4", keep=False)
    try:
        # The controller has been found.
        lockstep.run()
        times = []
        for _ in range(repetitions):
            lockstep.simulation.stop_time += steps * simulation.step_size
            there = timed(lockstep.run)
            times.append(there - timed(lambda: [simulation.step() for _ in range(steps)]))
        lockstep.close()
    finally:
        controller.kill()
        rclpy.shutdown()
    print(f"ros         {1e6 * median(times) / steps:7.1f} us a round trip")


def main() -> None:
    """Measure and print."""
    if ONE in sys.argv:
        answer()
        return
    given = options(__doc__).parse_args()
    print(python())
    pettingzoo(given.steps, given.repetitions)
    ros(given.steps, given.repetitions)


if __name__ == "__main__":
    main()
