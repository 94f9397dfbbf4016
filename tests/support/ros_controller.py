"""A controller in ROS, for a process of its own: `ros_controller.py END [PREFIX ...]`.

It answers odometry until all vehicles have reached the end, and prints the attitudes it has seen.
"""

from __future__ import annotations

import sys
from functools import partial

import rclpy
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock


def seconds(stamp) -> float:
    return stamp.sec + 1e-9 * stamp.nanosec


def wrench(odometry: Odometry) -> WrenchStamped:
    """A law whose steps round alike in all frames: it is odd in each variable."""
    place, twist = odometry.pose.pose.position, odometry.twist.twist
    answer = WrenchStamped(header=odometry.header)
    answer.wrench.force.x = 0.5 * place.x - 4.0 * twist.linear.x
    answer.wrench.torque.y = 0.25 * place.z - 3.0 * twist.angular.y
    answer.wrench.torque.z = 0.125 * place.y - 2.0 * twist.angular.z
    return answer


def main(end: float, *prefixes: str) -> None:
    rclpy.init()
    node = rclpy.create_node("controller")
    reached, clock = set(), [0.0]

    def answer(prefix: str, odometry: Odometry) -> None:
        publishers[prefix].publish(wrench(odometry))
        turn = odometry.pose.pose.orientation
        frames = odometry.header.frame_id, odometry.child_frame_id
        time = seconds(odometry.header.stamp)
        print(time, turn.x, turn.y, turn.z, turn.w, *frames, flush=True)
        if time >= end - 1e-6:
            reached.add(prefix)

    publishers = {}
    for prefix in prefixes:
        publishers[prefix] = node.create_publisher(WrenchStamped, f"{prefix}wrench", 10)
        node.create_subscription(Odometry, f"{prefix}odom", partial(answer, prefix), 10)
    node.create_subscription(Clock, "/clock", lambda at: clock.append(seconds(at.clock)), 10)
    while reached != {*prefixes} or clock[-1] < end - 1e-6:
        rclpy.spin_once(node)


if __name__ == "__main__":
    main(float(sys.argv[1]), *(sys.argv[2:] or [""]))
