"""Publishes images of given places at a steady pace and prints every answer: one JSON object a line.

Arguments: the places in order, as in ``1,2,3,1`` (``-`` to listen only); seconds between images; seconds to go on
listening; optionally a topic of images on which the answers come instead of objects. Image ``i`` has stamp ``i + 1`` s,
7 ns.
"""

import json
import sys
import time

import rospy
from detector import Array
from sensor_msgs.msg import Image


def image_of(index, place):
    image = Image(height=48, width=64, encoding="mono8", step=64, data=bytes([place]) * (64 * 48))
    image.header.stamp = rospy.Time(index + 1, 7)
    image.header.frame_id = "camera_02"
    return image


def on_answer(answer):
    line = {
        "stamp_ns": answer.header.stamp.to_nsec(),
        "frame_id": answer.header.frame_id,
        "seq": answer.header.seq,
        "after_s": time.monotonic() - sent.get(answer.header.stamp.to_nsec(), 0.0),
    }
    if isinstance(answer, Image):
        line["place"] = answer.data[0]
    else:
        line["objects"] = [[one.label, one.x, round(one.score, 3), one.user_defined_info] for one in answer.objects]
    print(json.dumps(line), flush=True)


def main(places, pause_s, listen_s, topic=None):
    rospy.init_node("camera", anonymous=True)
    answers = (topic, Image) if topic else ("/detection/image_detector/objects", Array)
    rospy.Subscriber(*answers, on_answer, buff_size=2**24, tcp_nodelay=True)
    images = rospy.Publisher("/image_raw", Image, queue_size=10, tcp_nodelay=True) if places else None
    print("up", flush=True)
    sys.stdin.readline()
    while places and not images.get_num_connections():
        time.sleep(0.01)
    for index, place in enumerate(places):
        image = image_of(index, place)
        sent[image.header.stamp.to_nsec()] = time.monotonic()
        images.publish(image)
        time.sleep(pause_s)
    time.sleep(listen_s)


sent = {}
if __name__ == "__main__":
    shown = [] if sys.argv[1] == "-" else [int(place) for place in sys.argv[1].split(",")]
    main(shown, float(sys.argv[2]), float(sys.argv[3]), *sys.argv[4:])
