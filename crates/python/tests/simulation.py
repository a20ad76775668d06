"""A simulated robot, cycle by cycle."""

import math
import subprocess
import threading
import time
import unittest

import numpy as np
import omnibase
from places import BMM, CIRCLE, FOLDER, MECANUM, PROGRAM


class Stepped(unittest.TestCase):
    def test_a_plan_gives_the_bits_of_the_command_line(self):
        file = FOLDER / "run.mcap"
        command = [PROGRAM, "run", BMM, "--circle", "radius_m=0.3,duration_s=6", "--record", file]
        subprocess.run(command, check=True, capture_output=True)
        recorded = omnibase.Recording(file)
        robot = omnibase.Simulation(BMM, reference=CIRCLE)
        self.assertEqual(robot.signals, recorded.signals)
        # The first cycle is done already.
        first = [robot[name] for name in recorded.signals]
        rows = np.vstack([first, robot.trace(len(recorded) - 1, ["*"])])
        for column, name in enumerate(recorded.signals):
            np.testing.assert_array_equal(rows[:, column], recorded[name], err_msg=name)
        self.assertGreater(len(recorded), 6000)
        self.assertTrue(robot.is_over and robot.has_finished)
        with self.assertRaisesRegex(omnibase.Refused, "drive|plan"):
            robot.go_to(0.0, 0.0, 0.0)

    def test_a_twist_from_python_moves_it_and_a_stop_ends_that(self):
        robot = omnibase.Simulation(MECANUM)
        self.assertEqual(robot.phase, "disabled")
        robot.drive(0.2, 0.1, 0.0)
        with self.assertRaisesRegex(omnibase.Refused, "drive: refused: .*; the robot is disabled"):
            robot.step()
        robot.enable()
        self.assertEqual(robot.phase, "holding")
        begun_s = robot.time_s
        robot.drive(0.2, 0.1, 0.0)
        robot.step(2000)
        self.assertAlmostEqual(robot.time_s - begun_s, 2000 * robot.cycle_s, places=9)
        for twist in (robot.twist, robot.true_twist):
            np.testing.assert_allclose(twist, (0.2, 0.1, 0.0), atol=0.01)
        np.testing.assert_allclose(robot.pose, robot.true_pose, atol=0.02)
        self.assertGreater(robot.true_pose[0], 0.25)
        self.assertEqual(robot["truth.pose_x_m"], robot.true_pose[0])
        self.assertEqual(len(robot.wheel_speeds_rad_s), 4)
        robot.stop("category_1")
        robot.step(3000)
        self.assertEqual(robot.phase, "disabled")
        stands = robot.true_pose
        robot.step(500)
        np.testing.assert_allclose(robot.true_pose, stands, atol=1e-4)

    def test_it_goes_to_a_pose(self):
        robot = omnibase.Simulation(BMM)
        robot.enable()
        robot.go_to(0.5, -0.3, 0.7)
        robot.step(10_000)
        self.assertEqual(robot.phase, "holding")
        np.testing.assert_allclose(robot.pose, (0.5, -0.3, 0.7), atol=2e-3)
        with self.assertRaises(omnibase.Refused):
            robot.go_to(math.nan, 0.0, 0.0)

    def test_no_number_moves_nothing(self):
        robot = omnibase.Simulation(BMM)
        robot.enable()
        robot.drive(math.nan, 0.0, 0.0)
        with self.assertRaises(omnibase.Refused):
            robot.step()
        robot.step(100)
        np.testing.assert_allclose(robot.true_pose, (0.0, 0.0, 0.0), atol=1e-4)

    def test_begun_again_it_does_the_same_to_the_bit(self):
        robot = omnibase.Simulation(BMM)

        def drives():
            robot.enable()
            robot.drive(0.1, -0.2, 0.3)
            return robot.trace(1500, ["state.*", "truth.*", "wheel_1.*"])

        first = drives()
        robot.reset()
        np.testing.assert_array_equal(first, drives())

    def test_a_controller_of_ones_own_in_ten_lines(self):
        robot = omnibase.Simulation(BMM)
        robot.enable()
        begun = robot.time_s
        errors = []
        while (t := robot.time_s - begun) < 6.0:
            wished = np.array([0.3 * math.sin(t), 0.3 - 0.3 * math.cos(t)])
            ahead = np.array([0.3 * math.cos(t), 0.3 * math.sin(t)])
            error = wished - robot.pose[:2]
            robot.drive(*(ahead + 3.0 * error), -3.0 * robot.pose[2], frame="odom")
            robot.step(10)
            errors.append(np.hypot(*(wished - robot.true_pose[:2])))
        self.assertLess(np.median(errors), 0.01)

    def test_other_threads_of_python_go_on_meanwhile(self):
        robot = omnibase.Simulation(BMM)
        ended = threading.Event()
        stepper = threading.Thread(target=lambda: (robot.step(4000), ended.set()))
        counted = 0
        stepper.start()
        while not ended.is_set():
            counted += 1
            time.sleep(0)
        stepper.join()
        self.assertGreater(counted, 100)

    def test_mistakes_are_told_in_the_products_words(self):
        wrong = [
            (dict(robot="nowhere.toml"), "reading `nowhere.toml`: No such file"),
            (dict(robot=BMM, settings={"limits.speed_m_s": -1.0}), "command line:1:.*limits.speed_m_s"),
            (dict(robot=BMM, settings={"controller.kid": "x"}), "did you mean `kind`"),
            (dict(robot=BMM, reference={"kind": "circle", "radius": 1.0}), "bmm.toml: reference.radius: .*write `radius_m`"),
            (dict(robot=BMM, reference=CIRCLE, path="x"), "expected one motion, found two"),
            (dict(robot=BMM, path="nowhere.dat"), "nowhere.dat"),
        ]
        for arguments, words in wrong:
            with self.assertRaisesRegex(omnibase.Error, words):
                omnibase.Simulation(**arguments)
        robot = omnibase.Simulation(BMM)
        with self.assertRaisesRegex(omnibase.Error, "did you mean `state.pose_x_m`"):
            robot["state.pose_x"]
        with self.assertRaisesRegex(omnibase.Error, "expected category_0"):
            robot.stop("now")
        with self.assertRaisesRegex(omnibase.Error, "expected `body` or `odom`"):
            robot.drive(0.0, 0.0, 0.0, frame="map")

    def test_settings_reach_the_robot(self):
        light, heavy = (omnibase.Simulation(BMM, settings={"simulation.payload_kg": kg}) for kg in (0.0, 150.0))
        torque = []
        for robot in (light, heavy):
            robot.enable()
            robot.drive(0.4, 0.0, 0.0)
            torque.append(np.abs(robot.trace(300, ["wheel_*.torque_nm"])).max())
        self.assertGreater(torque[1], 1.5 * torque[0])
