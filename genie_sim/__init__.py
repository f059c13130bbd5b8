"""genie-sim: a discrete-event simulator of Genie, smart ROS caching for connected autonomous robots."""

__version__ = "0.1.0"
