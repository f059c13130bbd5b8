"""East-north-up frames at places on the WGS 84 ellipsoid (pymap3d)."""

import numpy as np
import pymap3d

from genie_sim.base.geometry import Array, Geodetic, inverse, rigid


def ecef_SE3_enu(origin: Geodetic) -> Array:
    """The east-north-up frame at a geodetic origin (degrees, degrees, metres), seen from the
    Earth's centre.
    """
    latitude_deg, longitude_deg, altitude_m = origin
    axes = [pymap3d.enu2uvw(*axis, latitude_deg, longitude_deg) for axis in np.eye(3)]
    centre = pymap3d.geodetic2ecef(latitude_deg, longitude_deg, altitude_m)
    return rigid(np.array(axes, dtype=np.float64).T, np.array(centre, dtype=np.float64))


def enu_SE3_enu(to: Geodetic, source: Geodetic) -> Array:
    """Takes points of the frame at ``source`` to the frame at ``to``: two such frames differ by a
    rigid motion.
    """
    return inverse(ecef_SE3_enu(to)) @ ecef_SE3_enu(source)
