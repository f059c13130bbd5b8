"""Publishes images of given places in ROS 2 and prints every answer: one JSON object a line. See
``camera.py``; ``1@9`` puts the camera 9 m east here, too, looking east.
"""

import json
import sys
import threading
import time

import rclpy
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Image
from visualization_msgs.msg import MarkerArray

sent = {}


def on_answer(array):
    stamp = array.markers[0].header.stamp
    stamp_ns = stamp.sec * 10**9 + stamp.nanosec
    line = {
        "stamp_ns": stamp_ns,
        "frame_id": array.markers[0].header.frame_id,
        "after_s": time.monotonic() - sent.get(stamp_ns, 0.0),
        "objects": [
            [one.ns, one.id, round(one.color.a, 3), one.text]
            for one in array.markers
            if one.action == 0
        ],
    }
    print(json.dumps(line), flush=True)


def main(places, pause_s, listen_s):
    rclpy.init()
    node = rclpy.create_node("camera")
    node.create_subscription(MarkerArray, "/objects", on_answer, 10)
    images = node.create_publisher(Image, "/image_raw", 10)
    poses = node.create_publisher(PoseStamped, "/current_pose", 10)
    threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
    while not images.get_subscription_count() or not node.count_publishers("/objects"):
        time.sleep(0.05)
    time.sleep(1.0)
    for index, place in enumerate(places):
        if not rclpy.ok():
            break
        place, at, east = place.partition("@")
        data = bytes([int(place)]) * (64 * 48)
        image = Image(height=48, width=64, encoding="mono8", step=64, data=data)
        image.header.stamp.sec, image.header.stamp.nanosec, image.header.frame_id = (
            index + 1,
            7,
            "camera_02",
        )
        if at:
            pose = PoseStamped(header=image.header)
            pose.pose.position.x, pose.pose.orientation.w = float(east), 1.0
            poses.publish(pose)
            time.sleep(0.1)
        sent[(index + 1) * 10**9 + 7] = time.monotonic()
        images.publish(image)
        time.sleep(pause_s)
    time.sleep(listen_s)
    rclpy.shutdown()


main(sys.argv[1].split(","), float(sys.argv[2]), float(sys.argv[3]))
