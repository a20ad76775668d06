"""Durations of jerk-limited motions by Ruckig, the implementation of the method's authors: a problem a line in, a duration a line out."""

import json
import sys

from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory

planner = Ruckig(3)
for line in sys.stdin:
    from_, to, most = json.loads(line)
    problem = InputParameter(3)
    problem.synchronization = Synchronization.Phase
    problem.current_position, problem.current_velocity, problem.current_acceleration = zip(*from_)
    problem.target_position, problem.target_velocity, problem.target_acceleration = zip(*to)
    problem.max_velocity, problem.max_acceleration, problem.max_jerk = zip(*most)
    trajectory = Trajectory(3)
    result = planner.calculate(problem, trajectory)
    print(trajectory.duration if result in (Result.Working, Result.Finished) else "null")
