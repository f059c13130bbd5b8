"""An ordinary ROS 2 detector that has never heard of Genie: an image in, the objects "seen" in it
out, 50 ms later.

Objects are markers, because the wheels hold no vision_msgs. ``DETECTOR_SECONDS`` says how long it
takes. With ``DETECTOR_FRAME`` places are in that frame, and a marker without an object carries the
image's header.
"""

import contextlib
import os
import time

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray


class Detector(Node):
    def __init__(self):
        super().__init__("detector")
        self._objects = self.create_publisher(MarkerArray, "objects", 10)
        self.create_subscription(Image, "image_raw", self.on_image, 1)

    def on_image(self, image):
        time.sleep(float(os.environ.get("DETECTOR_SECONDS", "0.05")))
        place = image.data[0]
        found = Marker(header=image.header, ns="car", id=place, text=f"place {place}")
        found.pose.position.x = 10.0 * place
        found.color.a = 0.75
        markers = [found]
        frame = os.environ.get("DETECTOR_FRAME")
        if frame is not None:
            markers.insert(0, Marker(header=image.header, action=Marker.DELETEALL))
            found.header = Header(stamp=image.header.stamp, frame_id=frame)
        self._objects.publish(MarkerArray(markers=markers))


rclpy.init()
with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(Detector())
