"""Publishes images of given places at a steady pace and prints every answer: one JSON object a
line.

Arguments: the places in order, as in ``1,2,3,1`` (``-`` to listen only; ``1@9`` puts the camera 9 m
east, 5 m north, looking east); seconds between images; seconds to go on listening; optionally a
topic of images on which the answers come instead of objects. Image ``i`` has stamp ``i + 1`` s, 7
ns.
"""

import json
import sys
import time

import rospy
from detector import Array
from geometry_msgs.msg import PoseStamped
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
        line["objects"] = [
            [one.label, one.x, round(one.score, 3), one.user_defined_info] for one in answer.objects
        ]
    print(json.dumps(line), flush=True)


def main(places, pause_s, listen_s, topic=None):
    rospy.init_node("camera", anonymous=True)
    answers = (topic, Image) if topic else ("/detection/image_detector/objects", Array)
    listening = rospy.Subscriber(*answers, on_answer, buff_size=2**24, tcp_nodelay=True)
    images = (
        rospy.Publisher("/image_raw", Image, queue_size=10, tcp_nodelay=True) if places else None
    )
    poses = rospy.Publisher("/current_pose", PoseStamped, queue_size=10, tcp_nodelay=True)
    print("up", flush=True)
    sys.stdin.readline()
    while places and not (images.get_num_connections() and listening.get_num_connections()):
        time.sleep(0.01)
    for index, place in enumerate(places):
        if rospy.is_shutdown():
            break
        place, at, east = place.partition("@")
        image = image_of(index, int(place))
        if at:
            pose = PoseStamped(header=image.header)
            pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = (
                float(east),
                5.0,
                1.0,
            )
            poses.publish(pose)
            time.sleep(0.1)
        sent[image.header.stamp.to_nsec()] = time.monotonic()
        images.publish(image)
        time.sleep(pause_s)
    time.sleep(listen_s)


sent = {}
if __name__ == "__main__":
    shown = [] if sys.argv[1] == "-" else sys.argv[1].split(",")
    main(shown, float(sys.argv[2]), float(sys.argv[3]), *sys.argv[4:])
