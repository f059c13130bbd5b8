"""Lines of the files of KITTI's tracking benchmark."""

from __future__ import annotations

CALIBRATION = """P2: 721.5377 0 609.5593 44.85728 0 721.5377 172.854 0.2163791 0 0 1 0.002745884
R_rect 1 0 0 0 1 0 0 0 1
Tr_velo_cam 0 -1 0 0 0 0 -1 0 1 0 0 0
Tr_imu_velo 1 0 0 0 0 1 0 0 0 0 1 0
"""


OXTS = "49.0 8.4 112.0 0 0 0 " + "0 " * 24


CAR = "{frame},2,500.0,170.0,600.0,230.0,{logit},1.5,1.6,3.9,-2.0,1.6,20.0,-1.6,-1.5\n"
