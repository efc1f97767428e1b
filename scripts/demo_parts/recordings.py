"""What the demo reads back from its recordings: trajectories and rates."""
import bisect
import math

import rosbag


def normalized(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


def compose(a, b):
    """T_a_c of T_a_b and T_b_c, each (x, y, yaw)."""
    c, s = math.cos(a[2]), math.sin(a[2])
    return (a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], normalized(a[2] + b[2]))


def inverse(a):
    c, s = math.cos(a[2]), math.sin(a[2])
    return (-c * a[0] - s * a[1], s * a[0] - c * a[1], normalized(-a[2]))


def _yaw(q):
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def _pose(message):
    return (message.position.x, message.position.y, _yaw(message.orientation))


class Track:
    """Stamped poses in the order of their stamps."""

    def __init__(self):
        self.stamps, self.poses = [], []

    def add(self, stamp, pose):
        if not self.stamps or stamp > self.stamps[-1]:
            self.stamps.append(stamp)
            self.poses.append(pose)

    def at(self, stamp):
        """Interpolated; None outside."""
        i = bisect.bisect_left(self.stamps, stamp)
        if i == len(self.stamps) or (i == 0 and self.stamps[0] != stamp):
            return None
        if self.stamps[i] == stamp:
            return self.poses[i]
        t = (stamp - self.stamps[i - 1]) / (self.stamps[i] - self.stamps[i - 1])
        a, b = self.poses[i - 1], self.poses[i]
        return (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), normalized(a[2] + t * normalized(b[2] - a[2])))

    def length(self):
        return sum(math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip(self.poses, self.poses[1:]))

    def write_tum(self, path):
        with open(path, "w", encoding="utf-8") as out:
            for stamp, (x, y, yaw) in zip(self.stamps, self.poses):
                out.write(f"{stamp:.6f} {x:.6f} {y:.6f} 0 0 0 {math.sin(yaw / 2):.9f} {math.cos(yaw / 2):.9f}\n")


def read_tum(path):
    track = Track()
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            if line.strip() and not line.startswith("#"):
                v = [float(field) for field in line.split()]
                track.add(v[0], (v[1], v[2], 2.0 * math.atan2(v[6], v[7])))
    return track


class Recording:
    """Truth, odometry and what the localizer told the robot at each moment, from one bag."""

    def __init__(self, path):
        self.truth, self.odometry, self.estimate = Track(), Track(), Track()
        map_odom = None
        with rosbag.Bag(str(path)) as bag:
            for topic, message, _ in bag.read_messages(["/ground_truth", "/odom", "/tf"]):
                if topic == "/ground_truth":
                    self.truth.add(message.header.stamp.to_sec(), _pose(message.pose.pose))
                elif topic == "/odom":
                    odom = _pose(message.pose.pose)
                    self.odometry.add(message.header.stamp.to_sec(), odom)
                    # map -> odom is stamped ahead on purpose: what counts is the newest the robot had by now.
                    if map_odom is not None:
                        self.estimate.add(message.header.stamp.to_sec(), compose(map_odom, odom))
                else:
                    for transform in message.transforms:
                        if transform.header.frame_id.strip("/") == "map":
                            t = transform.transform
                            map_odom = (t.translation.x, t.translation.y, _yaw(t.rotation))


def position_errors(estimate, truth, world_map):
    """Distances [m] and angles [rad] between estimate (map frame) and truth (world frame)."""
    distances, angles = [], []
    for stamp, pose in zip(estimate.stamps, estimate.poses):
        true = truth.at(stamp)
        if true is None:
            continue
        seen = compose(world_map, pose)
        distances.append(math.hypot(seen[0] - true[0], seen[1] - true[1]))
        angles.append(abs(normalized(seen[2] - true[2])))
    return distances, angles
