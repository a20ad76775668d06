"""A thousand simulated robots of 20 s each, side by side: how many steps a second.

python thousand_robots.py ROBOT.toml [ROBOTS [SECONDS]]
"""

import sys
import time

import numpy as np
import omnibase

file = sys.argv[1]
count = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
robot_s = float(sys.argv[3]) if len(sys.argv) > 3 else 20.0
begun = time.perf_counter()
robots = omnibase.Simulations(file, count)
robots.enable()
print(f"{count} robots brought up and enabled in {time.perf_counter() - begun:.1f} s")
twists = np.random.default_rng(1).uniform(-0.3, 0.3, (count, 3))
robots.drive(twists)
cycles = round(robot_s / robots.cycle_s)
begun = time.perf_counter()
drive = robots.step(cycles)
took_s = time.perf_counter() - begun
print(f"{count} robots x {cycles} cycles in {took_s:.1f} s: {count * cycles / took_s:.0f} steps a second")
believed = robots.values(["state.pose_x_m", "state.pose_y_m"])
truth = robots.values(["truth.pose_x_m", "truth.pose_y_m"])
off_m = np.hypot(*(believed - truth).T)
print(f"{sum(drive)} drive still; the worst pose is {1e3 * off_m.max():.1f} mm off, the median {1e3 * np.median(off_m):.1f} mm")
