"""Tables of poses, detections and truth as somebody else writes them."""

from __future__ import annotations

# Car a stands at (10, 5) and looks north; b begins 0.25 s later elsewhere and looks west.
POSES = """car,time_s,east_m,north_m,heading_deg
a,1000.0,10,5,90
a,1000.1,10,5,90
b,1000.25,-3,7,180
a,1000.2,10,5,450
b,1000.35,-4,7,180
"""


DETECTIONS = """car,time_s,label,east_m,north_m,score
a,1000.1,car,12,25,0.5
b,1000.25,person,-23,8,0.875
a,1000.1,truck,9,15,0.75
"""


TRUTH_HEADER = "time_s,object,label,east_m,north_m\n"


TRUTH = f"""{TRUTH_HEADER}1000.0,bus 7,bus,10,25
999.95,walker,person,-3,20
1001.0,bus 7,bus,10,35
1000.95,walker,person,-3,20.2
"""
