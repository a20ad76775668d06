"""Environments of gymnasium, as its own checks see them."""

import unittest
import warnings

import numpy as np
from gymnasium.utils.env_checker import check_env
from omnibase.gymnasium import ARRIVED_REWARD, GoalEnv, GoalVectorEnv
from places import BMM, MECANUM


def towards_goal(observation):
    """The twist of somebody who sees the goal, as shares of the greatest."""
    return np.clip(np.append(4.0 * observation[..., :2], np.zeros(observation.shape[:-1] + (1,)), axis=-1), -1.0, 1.0)


class Environments(unittest.TestCase):
    def test_gymnasiums_own_check_passes(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # It was made without gymnasium.make: nothing about the environment itself.
            warnings.filterwarnings("ignore", message=".*not wrapped|.*spec")
            check_env(GoalEnv(MECANUM, time_s=2.0), skip_render_check=True)

    def test_who_drives_towards_the_goal_arrives(self):
        env = GoalEnv(BMM)
        observation, _ = env.reset(seed=7)
        far_m, rewards, over = np.hypot(*observation[:2]), 0.0, False
        while not over:
            observation, reward, arrived, cut, _ = env.step(towards_goal(observation))
            rewards, over = rewards + reward, arrived or cut
        self.assertTrue(arrived)
        self.assertAlmostEqual(rewards, ARRIVED_REWARD + far_m - np.hypot(*observation[:2]), places=9)

    def test_an_episode_is_cut_off_after_its_time(self):
        env = GoalEnv(BMM, time_s=0.5)
        env.reset(seed=1)
        ends = [env.step(np.zeros(3))[2:4] for _ in range(10)]
        self.assertEqual(ends, [(False, False)] * 9 + [(False, True)])

    def test_many_do_each_what_one_does_alone(self):
        many = GoalVectorEnv(BMM, 4, time_s=1.0)
        seen, _ = many.reset(seed=10)
        self.assertEqual(seen.shape, (4, 7))
        alone = [GoalEnv(BMM, time_s=1.0) for _ in range(4)]
        for at, env in enumerate(alone):
            np.testing.assert_array_equal(seen[at], env.reset(seed=10 + at)[0])
        for _ in range(20):
            actions = towards_goal(seen)
            before = [env.step(actions[at]) for at, env in enumerate(alone)]
            seen, rewards, arrived, cut, _ = many.step(actions)
            for at, (observation, reward, one_arrived, one_cut, _) in enumerate(before):
                np.testing.assert_array_equal(seen[at], observation)
                self.assertEqual((rewards[at], arrived[at], cut[at]), (reward, one_arrived, one_cut))
        self.assertTrue(all(cut))
        # The next step begins all of them again, each at the beginning of an episode with a goal of its own.
        seen, rewards, arrived, cut, _ = many.step(np.ones((4, 3)))
        self.assertEqual((list(rewards), any(arrived | cut)), ([0.0] * 4, False))
        np.testing.assert_allclose(seen[:, 4:], 0.0, atol=1e-3)
        self.assertEqual(len(np.unique(seen[:, 0])), 4)
