"""omnibase for Python: simulated robots, cycle by cycle and many side by side, recordings, running robots.

Lengths are in m, angles in rad, times in s. A pose is (x, y, heading) in odom; a twist is (vx, vy, turn), in the platform's
frame unless something else is said.
"""

from ._omnibase import (
    Error,
    Kinematics,
    Moment,
    Odometry,
    Recording,
    Refused,
    Robot,
    Signals,
    Simulation,
    Simulations,
    __version__,
    exchange,
    scan,
    sdo_read,
    sdo_write,
    trajectory,
)

__all__ = [
    "Error",
    "Kinematics",
    "Moment",
    "Odometry",
    "Recording",
    "Refused",
    "Robot",
    "Signals",
    "Simulation",
    "Simulations",
    "__version__",
    "exchange",
    "scan",
    "sdo_read",
    "sdo_write",
    "trajectory",
]
