"""Publishes images of given places at a steady pace and prints every answer: one JSON object a line.

Arguments: the places in order, as in ``1,2,3,1``; seconds between images; seconds to go on listening. Image ``i`` has
stamp ``i + 1`` s, 7 ns.
"""

import json
import sys
import time

import rospy
from detector import Array
from sensor_msgs.msg import Image

PIXELS = 64 * 48


def on_answer(answer):
    line = {
        "stamp_ns": answer.header.stamp.to_nsec(),
        "frame_id": answer.header.frame_id,
        "seq": answer.header.seq,
        "after_s": time.monotonic() - sent.get(answer.header.stamp.to_nsec(), 0.0),
        "objects": [[one.label, one.x, round(one.score, 3), one.user_defined_info] for one in answer.objects],
    }
    print(json.dumps(line), flush=True)


def main(places, pause_s, listen_s):
    rospy.init_node("camera", anonymous=True)
    rospy.Subscriber("/detection/image_detector/objects", Array, on_answer, tcp_nodelay=True)
    images = rospy.Publisher("/image_raw", Image, queue_size=10, tcp_nodelay=True)
    print("up", flush=True)
    sys.stdin.readline()
    while not images.get_num_connections():
        time.sleep(0.01)
    for index, place in enumerate(places):
        image = Image(height=48, width=64, encoding="mono8", step=64, data=bytes([place]) * PIXELS)
        image.header.stamp = rospy.Time(index + 1, 7)
        image.header.frame_id = "camera_02"
        sent[image.header.stamp.to_nsec()] = time.monotonic()
        images.publish(image)
        time.sleep(pause_s)
    time.sleep(listen_s)


sent = {}
main([int(place) for place in sys.argv[1].split(",")], float(sys.argv[2]), float(sys.argv[3]))
