"""An ordinary ROS 1 detector that has never heard of Genie: an image in, the objects "seen" in it
out, 50 ms later. It notes the images that it has seen in a file, ``seen``.

Its message classes come from the definitions beside it, because Debian packages no autoware_msgs.
"""

import time
from pathlib import Path

import rospy
from genpy.dynamic import generate_dynamic
from sensor_msgs.msg import Image

TYPES = generate_dynamic(
    "autoware_msgs/DetectedObjectArray", Path(__file__).with_name("objects.txt").read_text()
)
Array, Object = TYPES["autoware_msgs/DetectedObjectArray"], TYPES["autoware_msgs/DetectedObject"]


def on_image(image):
    time.sleep(rospy.get_param("~seconds", 0.05))
    place = image.data[0]  # the test's images say where they were taken
    with Path("seen").open("a") as seen:
        seen.write(f"{place}\n")
    found = Object(
        header=image.header,
        label=rospy.get_param("~label", "car"),
        score=0.75,
        valid=True,
        space_frame="map",
        x=place,
    )
    found.pose.position.x, found.pose.position.y = 10.0 * place, 5.0
    found.pose.orientation.w = 1.0
    found.user_defined_info = ["place", str(place)]
    publisher.publish(Array(header=image.header, objects=[found]))


if __name__ == "__main__":
    rospy.init_node("vision_darknet_detect")
    publisher = rospy.Publisher("/detection/image_detector/objects", Array, queue_size=1)
    rospy.Subscriber("/image_raw", Image, on_image, queue_size=1, buff_size=2**24)
    rospy.spin()
