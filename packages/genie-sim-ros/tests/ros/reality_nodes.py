"""Ordinary ROS 1 nodes with known times, for the comparison of simulation and reality. None has
heard of Genie.

``camera PLAN``: shows the frames of a plan and prints when each was published and answered [ns, the
machine's clock]. ``detector PLAN``: sleeps for the next time of the plan, then says what the plan
found under this stamp. ``sender SIZES COUNT`` and ``receiver COUNT``: how long messages take from
one process to another.

A plan is a JSON file: ``frames``, each with ``at_ns``, ``size_bytes``, ``pose`` (east, north, up,
heading) and ``objects`` (label, score, east, north, up); and ``sleeps_ns``, the detector's times in
order.
"""

import json
import math
import sys
import time
from pathlib import Path

import rospy
from detector import Array, Object
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Image

IMAGES, OBJECTS, POSES, PROBE = (
    "/image_raw",
    "/detection/image_detector/objects",
    "/current_pose",
    "/probe",
)
FIRST_STAMP_NS = 10**9
POSE_AHEAD_S = 0.02
BUFFER_BYTES = 2**24


def stamp_of(at_ns):
    return rospy.Time(*divmod(FIRST_STAMP_NS + at_ns, 10**9))


def image_of(frame, data):
    """An image message of exactly ``size_bytes``: KITTI's pictures cannot be shipped, and nobody
    here looks at them.
    """
    image = Image(height=1, encoding="bgr8")
    image.header.stamp, image.header.frame_id = stamp_of(frame["at_ns"]), "camera_02"
    image.width = image.step = frame["size_bytes"] - 50
    image.data = data[: image.step]
    return image


def pose_of(frame):
    pose = PoseStamped()
    pose.header.stamp = stamp_of(frame["at_ns"])
    place = pose.pose.position
    place.x, place.y, place.z, heading_rad = frame["pose"]
    pose.pose.orientation.z, pose.pose.orientation.w = (
        math.sin(heading_rad / 2),
        math.cos(heading_rad / 2),
    )
    return pose


def camera(plan):
    answered = {}

    def on_answer(answer):
        answered.setdefault(answer.header.stamp.to_nsec() - FIRST_STAMP_NS, time.monotonic_ns())

    rospy.init_node("camera")
    listening = rospy.Subscriber(OBJECTS, Array, on_answer, tcp_nodelay=True)
    images = rospy.Publisher(IMAGES, Image, queue_size=10, tcp_nodelay=True)
    poses = rospy.Publisher(POSES, PoseStamped, queue_size=10, tcp_nodelay=True)
    while not (
        images.get_num_connections()
        and poses.get_num_connections()
        and listening.get_num_connections()
    ):
        time.sleep(0.01)
    time.sleep(0.5)
    data = bytes(max(frame["size_bytes"] for frame in plan["frames"]))
    began_s, published = time.monotonic() + 0.1, {}
    for frame in plan["frames"]:
        image, at_s = image_of(frame, data), began_s + frame["at_ns"] / 1e9
        time.sleep(max(0.0, at_s - POSE_AHEAD_S - time.monotonic()))
        poses.publish(pose_of(frame))
        time.sleep(max(0.0, at_s - time.monotonic()))
        published[frame["at_ns"]] = time.monotonic_ns()
        images.publish(image)
    time.sleep(1.0)
    print(
        json.dumps([[at_ns, sent_ns, answered.get(at_ns)] for at_ns, sent_ns in published.items()]),
        flush=True,
    )


def detector(plan):
    sleeps_s = iter([sleep_ns / 1e9 for sleep_ns in plan["sleeps_ns"]])
    found = {FIRST_STAMP_NS + frame["at_ns"]: frame["objects"] for frame in plan["frames"]}

    def on_image(image):
        time.sleep(next(sleeps_s))
        answer = Array(header=image.header)
        for label, score, east, north, up in found[image.header.stamp.to_nsec()]:
            one = Object(
                header=image.header, label=label, score=score, valid=True, space_frame="map"
            )
            one.pose.position.x, one.pose.position.y, one.pose.position.z = east, north, up
            one.pose.orientation.w = 1.0
            answer.objects.append(one)
        publisher.publish(answer)

    rospy.init_node("vision_darknet_detect")
    publisher = rospy.Publisher(OBJECTS, Array, queue_size=10, tcp_nodelay=True)
    rospy.Subscriber(
        IMAGES, Image, on_image, queue_size=1, buff_size=BUFFER_BYTES, tcp_nodelay=True
    )
    rospy.spin()


def sender(sizes, count):
    rospy.init_node("sender")
    publisher = rospy.Publisher(PROBE, Image, queue_size=10, tcp_nodelay=True)
    while not publisher.get_num_connections():
        time.sleep(0.01)
    time.sleep(0.5)
    for size_bytes in sizes:
        data = bytes(size_bytes)
        for number in range(count):
            image = image_of({"at_ns": number, "size_bytes": size_bytes}, data)
            image.header.stamp = rospy.Time(*divmod(time.monotonic_ns(), 10**9))
            publisher.publish(image)
            time.sleep(0.02)
    time.sleep(0.5)


def receiver(count):
    """Prints a line for each message: its size, and how long it took."""
    left = [count]

    def on_message(raw):
        now_ns = time.monotonic_ns()
        seconds, nanoseconds = (int.from_bytes(raw._buff[at : at + 4], "little") for at in (4, 8))
        print(len(raw._buff), now_ns - seconds * 10**9 - nanoseconds, flush=True)
        left[0] -= 1
        if not left[0]:
            rospy.signal_shutdown("done")

    rospy.init_node("receiver")
    rospy.Subscriber(
        PROBE, rospy.AnyMsg, on_message, queue_size=10, buff_size=BUFFER_BYTES, tcp_nodelay=True
    )
    rospy.spin()


if __name__ == "__main__":
    role = sys.argv[1]
    if role in ("camera", "detector"):
        {"camera": camera, "detector": detector}[role](json.loads(Path(sys.argv[2]).read_text()))
    elif role == "sender":
        sender([int(size) for size in sys.argv[2].split(",")], int(sys.argv[3]))
    else:
        receiver(int(sys.argv[2]))
