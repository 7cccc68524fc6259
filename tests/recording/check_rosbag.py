#!/usr/bin/python3
"""Reads a recording with ROS's own rosbag and holds it against the run's results.

    check_rosbag.py BAG RUN COUNTS

RUN: the folder of the run's results. COUNTS: file for what was found, by topic. Exit code 77 where
ROS's packages are not installed.
"""
import json
import math
import sqlite3
import subprocess
import sys
from collections import Counter

try:
    import rosbag
    import roslib.message
    import yaml

    for name in ("sensor_msgs/Image", "tf2_msgs/TFMessage", "trajectory_msgs/JointTrajectory",
                 "visualization_msgs/MarkerArray", "std_msgs/UInt8MultiArray"):
        if roslib.message.get_message_class(name) is None:
            raise ImportError(f"no messages {name}")
except ImportError as error:
    print(f"skipped: {error} (tools/install_deps.sh --dev)")
    sys.exit(77)

TYPES = {
    "/camera/depth/image_rect": "sensor_msgs/Image",
    "/camera/depth/camera_info": "sensor_msgs/CameraInfo",
    "/tf": "tf2_msgs/TFMessage",
    "/joint_states": "sensor_msgs/JointState",
    "/sidestep/trajectory": "trajectory_msgs/JointTrajectory",
    "/sidestep/robot": "visualization_msgs/MarkerArray",
    "/sidestep/map": "visualization_msgs/MarkerArray",
    "/sidestep/scene": "visualization_msgs/MarkerArray",
    "/sidestep/moving": "visualization_msgs/MarkerArray",
    "/sidestep/paths": "visualization_msgs/MarkerArray",
    "/sidestep/events": "std_msgs/String",
    "/sidestep/view": "std_msgs/UInt8MultiArray",
}


def check_info(bag_file):
    """What `rosbag info` says; returns the counts."""
    text = subprocess.run(["rosbag", "info", "--yaml", bag_file], check=True, capture_output=True,
                          text=True).stdout
    info = yaml.safe_load(text)
    assert info["indexed"] and info["compression"] == "none", info
    found = {topic["topic"]: (topic["type"], topic["messages"]) for topic in info["topics"]}
    assert {topic: kind for topic, (kind, _) in found.items()} == TYPES, found
    for kind in info["types"]:
        assert kind["md5"] == roslib.message.get_message_class(kind["type"])._md5sum, kind
    return found


def read_all(bag_file):
    """All messages by topic, as the installed classes of their types read them."""
    messages = {}
    with rosbag.Bag(bag_file) as bag:
        for topic, raw, time in bag.read_messages(raw=True):
            kind, data = raw[0], raw[1]
            message = roslib.message.get_message_class(kind)()
            message.deserialize(data)
            messages.setdefault(topic, []).append((time, message))
    return messages


def rotated(q, v):
    """A vector turned by a unit quaternion (x, y, z, w)."""
    x, y, z, w = q
    tx, ty, tz = (2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0]))
    return (v[0] + w * tx + y * tz - z * ty, v[1] + w * ty + z * tx - x * tz,
            v[2] + w * tz + x * ty - y * tx)


def position_of(frame, transforms):
    """Where a frame's origin is in the world, parent by parent."""
    p = (0.0, 0.0, 0.0)
    while frame != "world":
        parent, t, q = transforms[frame]
        p = rotated(q, p)
        p = (p[0] + t[0], p[1] + t[1], p[2] + t[2])
        frame = parent
    return p


def check_poses(messages):
    """The links of the robot `point` are where its joints x and y say; returns how many were compared."""
    joints = {str(m.header.stamp): dict(zip(m.name, m.position)) for _, m in messages["/joint_states"]}
    compared = 0
    for _, message in messages["/tf"]:
        transforms = {}
        for one in message.transforms:
            t, q = one.transform.translation, one.transform.rotation
            assert abs(math.hypot(q.x, q.y, q.z, q.w) - 1.0) < 1e-9, q
            transforms[one.child_frame_id] = (one.header.frame_id, (t.x, t.y, t.z), (q.x, q.y, q.z, q.w))
        if "body" not in transforms:
            assert list(transforms) == ["camera_optical_frame"], transforms
            continue
        q = joints[str(message.transforms[0].header.stamp)]
        p = position_of("body", transforms)
        assert abs(p[0] - q["x"]) < 1e-9 and abs(p[1] - q["y"]) < 1e-9, (p, q)
        compared += 1
    return compared


def main(bag_file, run, counts_file):
    found = check_info(bag_file)
    messages = read_all(bag_file)
    counts = Counter({topic: len(those) for topic, those in messages.items()})
    assert {topic: count for topic, (_, count) in found.items()} == counts, (found, counts)

    with open(f"{run}/summary.json", encoding="utf-8") as file:
        summary = json.load(file)
    with sqlite3.connect(f"file:{run}/results.sqlite?mode=ro", uri=True) as results:
        events = results.execute("SELECT count(DISTINCT item) FROM measurements WHERE series='event'").fetchone()[0]
    assert events > 0 and counts["/sidestep/events"] == events + 3, (events, counts)
    for topic in ("/camera/depth/image_rect", "/camera/depth/camera_info"):
        assert counts[topic] == summary["frames"], (topic, counts, summary["frames"])

    told = [json.loads(m.data) for _, m in messages["/sidestep/events"]]
    assert told[0]["event"] == "begin" and told[-2]["event"] == "end" and told[-1]["event"] == "recorded"
    assert told[-2]["success"] == summary["success"]
    assert set(told[-1]["dropped"].values()) == {0}, told[-1]

    # A step every 4 ms, but for the one position that is told before the first step.
    stamps = [m.header.stamp.to_nsec() for _, m in messages["/joint_states"]][1:]
    assert {b - a for a, b in zip(stamps, stamps[1:])} == {4_000_000}, "steps are missing"
    compared = check_poses(messages)
    assert compared >= 0.9 * (stamps[-1] - stamps[0]) / 20e6, compared

    with open(counts_file, "w", encoding="utf-8") as file:
        json.dump({topic: {"type": kind, "count": count} for topic, (kind, count) in found.items()}, file)
    print(f"{sum(counts.values())} messages, {len(counts)} topics, {compared} poses compared")


main(*sys.argv[1:])
