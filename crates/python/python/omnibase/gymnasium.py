"""Environments of gymnasium: a simulated robot drives to a goal by twists, one of it and many side by side.

An action is a twist in the platform's frame as shares of the greatest speeds, each -1 to 1. An observation is where the goal
is as the robot sees it (x and y ahead and to the left in m, cosine and sine of the heading that is left), and the twist at
which the robot believes to move (m/s, rad/s). The reward is the way that it came nearer to the goal in m, and
``ARRIVED_REWARD`` at the goal. An episode ends at the goal, or where the robot stopped by itself; it is cut off after
``time_s``. The seed draws the goal, that of the n-th robot the seed and n; nothing else is chance.
"""

from __future__ import annotations

from os import PathLike
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from ._omnibase import Simulations

__all__ = ["ARRIVED_REWARD", "GoalEnv", "GoalVectorEnv"]

ARRIVED_REWARD = 1.0
_SIGNALS = [
    "state.pose_x_m",
    "state.pose_y_m",
    "state.pose_heading_rad",
    "state.twist_in_body_x_m_s",
    "state.twist_in_body_y_m_s",
    "state.twist_in_body_heading_rad_s",
]
_HIGH = np.array([100.0, 100.0, 1.0, 1.0, 10.0, 10.0, 20.0])


class GoalVectorEnv(VectorEnv):
    """Many robots, each on its way to a goal of its own. One whose episode ended begins again with the next step."""

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        robot: str | PathLike[str],
        num_envs: int,
        *,
        settings: dict[str, Any] | None = None,
        step_s: float = 0.05,
        time_s: float = 20.0,
        greatest_m: float = 1.0,
        speed_m_s: float = 0.5,
        turn_rad_s: float = 1.0,
        arrived_m: float = 0.05,
        threads: int | None = None,
    ) -> None:
        self.num_envs = num_envs
        self.single_observation_space = spaces.Box(-_HIGH, _HIGH, dtype=np.float64)
        self.single_action_space = spaces.Box(-1.0, 1.0, (3,), dtype=np.float64)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.robots = Simulations(robot, num_envs, settings=settings, threads=threads)
        self._cycles = max(1, round(step_s / self.robots.cycle_s))
        self._steps = max(1, round(time_s / (self._cycles * self.robots.cycle_s)))
        self._greatest_m = greatest_m
        self._speeds = np.array([speed_m_s, speed_m_s, turn_rad_s])
        self._arrived_m = arrived_m
        self._randoms = [np.random.default_rng() for _ in range(num_envs)]
        self._goals = np.zeros((num_envs, 3))
        self._done = np.zeros(num_envs, dtype=bool)
        self._taken = np.zeros(num_envs, dtype=int)
        self._distance_m = np.zeros(num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        if isinstance(seed, int):
            seed = [seed + at for at in range(self.num_envs)]
        for at, one in enumerate(seed or []):
            if one is not None:
                self._randoms[at] = np.random.default_rng(one)
        self._begin(np.arange(self.num_envs))
        return self._observation(), {}

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        again = np.flatnonzero(self._done)
        if len(again):
            self._begin(again)
        begun_m = self._distance_m
        shares = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0)
        # What begins again stands in this step: its action was meant for the episode before.
        shares[again] = 0.0
        self.robots.drive(shares * self._speeds)
        went = np.array(self.robots.step(self._cycles))
        observation = self._observation()
        arrived = self._distance_m < self._arrived_m
        arrived[again] = False
        reward = begun_m - self._distance_m + ARRIVED_REWARD * arrived
        reward[again] = 0.0
        self._taken += 1
        self._taken[again] = 0
        terminated = arrived | ~went
        truncated = ~terminated & (self._taken >= self._steps)
        self._done = terminated | truncated
        return observation, reward, terminated, truncated, {}

    def _begin(self, which: np.ndarray) -> None:
        robots = [int(at) for at in which]
        self.robots.reset(robots)
        self.robots.enable(robots)
        for at in robots:
            reach = self._greatest_m
            self._goals[at] = self._randoms[at].uniform((-reach, -reach, -np.pi), (reach, reach, np.pi))
        self._taken[which] = 0
        self._done[which] = False
        self._observation()

    def _observation(self) -> np.ndarray:
        x, y, heading, *twist = self.robots.values(_SIGNALS).T
        ahead, left = self._goals[:, 0] - x, self._goals[:, 1] - y
        turn = self._goals[:, 2] - heading
        cosine, sine = np.cos(heading), np.sin(heading)
        self._distance_m = np.hypot(ahead, left)
        seen = [cosine * ahead + sine * left, cosine * left - sine * ahead, np.cos(turn), np.sin(turn), *twist]
        return np.clip(np.stack(seen, axis=1), -_HIGH, _HIGH)


class GoalEnv(gymnasium.Env):
    """One robot on its way to a goal: as ``GoalVectorEnv`` has many, with the same settings."""

    metadata = {"render_modes": []}

    def __init__(self, robot: str | PathLike[str], **settings: Any) -> None:
        self._one = GoalVectorEnv(robot, 1, **settings)
        self.observation_space = self._one.single_observation_space
        self.action_space = self._one.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        observation, info = self._one.reset(seed=seed)
        return observation[0], info

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self._one.step(np.asarray(action)[np.newaxis])
        return observation[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), info
