"""Writes a bag of images: ``make_bag.py FILE PLACES SECONDS_BETWEEN``."""

import sys

import rosbag
import rospy
from camera import image_of

path, places, pause_s = sys.argv[1], sys.argv[2].split(","), float(sys.argv[3])
with rosbag.Bag(path, "w") as bag:
    for index, place in enumerate(places):
        bag.write(
            "/image_raw", image_of(index, int(place)), rospy.Time.from_sec(1 + index * pause_s)
        )
