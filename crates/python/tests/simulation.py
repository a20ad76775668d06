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

    def test_a_law_of_torques_of_ones_own_in_ten_lines(self):
        wheels = omnibase.Kinematics(BMM)

        def law(now):
            error = np.subtract(now.wished_pose, now.pose)
            slower = np.subtract(now.wished_twist, now.twist)
            force = np.array([70, 70, 7]) * now.wished_acceleration + [2000, 2000, 200] * error + [700, 700, 70] * slower
            ahead, left = np.cos(now.pose[2]), np.sin(now.pose[2])
            return wheels.wheel_torques_nm((ahead * force[0] + left * force[1], ahead * force[1] - left * force[0], force[2]))

        robot = omnibase.Simulation(BMM, reference=CIRCLE, controller=law)
        rows = robot.trace(9000, ["error.true_m", "command.quantity", "wheel_*.torque_nm"])
        self.assertTrue(robot.has_finished, robot.stop_reason)
        self.assertEqual(rows[:, 1].max(), 2.0)
        self.assertLess(np.abs(rows[:, 0]).max(), 0.02)
        self.assertGreater(np.abs(rows[:, 2:]).max(), 0.1)
        # Begun again it gives the same bits, by twists too.
        robot.reset()
        np.testing.assert_array_equal(rows, robot.trace(9000, ["error.true_m", "command.quantity", "wheel_*.torque_nm"]))

    def test_a_law_that_fails_stops_the_robot_until_it_is_enabled_again(self):
        says = []
        wheels = omnibase.Kinematics(BMM)

        def law(now):
            if says:
                answer = says[0]
                return answer() if callable(answer) else answer
            error = np.subtract(now.wished_pose, now.pose)
            slower = np.subtract(now.wished_twist, now.twist)
            force = [2000, 2000, 200] * error + [700, 700, 70] * slower
            return wheels.wheel_torques_nm(tuple(force))

        def divides():
            return 1 / 0

        for answer, raised in [
            ([math.nan, 0.0, 0.0], None),
            ([0.0, math.inf, 0.0], None),
            ([0.0, 0.0], "expected a torque for each of 3 wheels, found 2"),
            (["much", 0.0, 0.0], "str"),
            (None, "None"),
            (divides, "division by zero"),
        ]:
            robot = omnibase.Simulation(BMM, controller=law)
            says.clear()
            robot.enable()
            robot.drive(0.2, 0.0, 0.0)
            robot.step(1500)
            self.assertGreater(robot.true_twist[0], 0.15)
            says.append(answer)
            if raised is None:
                with self.assertRaises(omnibase.Refused):
                    robot.step(10)
            else:
                with self.assertRaisesRegex(Exception, raised):
                    robot.step()
            # It stops by what it is: a number that is none.
            robot.step(3000)
            self.assertIn("finite", robot.stop_reason)
            self.assertLess(np.abs(robot.true_twist).max(), 1e-3)
            # A law that is well again moves nothing by itself.
            says.clear()
            stands = robot.true_pose
            robot.step(1000)
            np.testing.assert_allclose(robot.true_pose, stands, atol=1e-3)
            robot.enable()
            robot.drive(0.2, 0.0, 0.0)
            robot.step(1500)
            self.assertGreater(robot.true_twist[0], 0.15)

    def test_a_law_that_heeds_nothing_has_no_more_torque_than_its_limit_and_is_stopped_by_the_drives(self):
        robot = omnibase.Simulation(BMM, controller=lambda now: [1e308, -1e308, 1e300])
        robot.enable()
        rows = robot.trace(2000, ["wheel_*.allowed", "allowed.reason", "wheel_*.torque_nm"])
        # The file's limit is 21 N m.
        self.assertLessEqual(np.abs(rows[:, :3]).max(), 21.0)
        self.assertLess(np.abs(rows[:, 4:]).max(), 1.2 * 21.0)
        self.assertGreater(rows[:, 3].max(), 0)
        # It doesn't follow the ramp of its stop either, and is cut off long before `safety.stop_timeout_ms`.
        robot.step(1500)
        self.assertRegex(robot.stop_reason, "turned faster than its limit|too far from where it should be")
        self.assertLess(np.abs(robot.true_twist).max(), 1e-3)
        self.assertLess(max(abs(speed) for speed in robot.wheel_speeds_rad_s), 0.05)

    def test_in_real_time_a_cycle_waits_for_the_clock_and_the_bits_are_the_same(self):
        fast, slow = omnibase.Simulation(BMM), omnibase.Simulation(BMM, realtime=True)
        traces = []
        for robot in (fast, slow):
            robot.enable()
            robot.drive(0.1, 0.2, -0.3)
            begun, before = time.monotonic(), time.process_time()
            traces.append(robot.trace(1000, ["state.*", "truth.*", "wheel_*"]))
        took, worked = time.monotonic() - begun, time.process_time() - before
        np.testing.assert_array_equal(*traces)
        # 1000 cycles of 1 ms; what it may run ahead of is bounded, what a busy machine adds isn't.
        self.assertGreater(took, 0.9)
        self.assertLess(worked, took)
        ended = threading.Event()
        stepper = threading.Thread(target=lambda: (slow.step(300), ended.set()))
        stepper.start()
        counted = 0
        while not ended.is_set():
            counted += 1
            time.sleep(0.001)
        stepper.join()
        # None where it held them up; how many a busy machine lets.
        self.assertGreater(counted, 10)

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
        self.assertGreater(counted, 10)

    def test_mistakes_are_told_in_the_products_words(self):
        wrong = [
            (dict(robot="nowhere.toml"), "reading `nowhere.toml`: No such file"),
            (dict(robot=BMM, settings={"limits.speed_m_s": -1.0}), "command line:1:.*limits.speed_m_s"),
            (dict(robot=BMM, settings={"controller.kid": "x"}), "did you mean `kind`"),
            (dict(robot=BMM, reference={"kind": "circle", "radius": 1.0}), "bmm.toml: reference.radius: .*write `radius_m`"),
            (dict(robot=BMM, reference=CIRCLE, path="x"), "expected one motion, found two"),
            (dict(robot=BMM, path="nowhere.dat"), "nowhere.dat"),
            (dict(robot=BMM, controller=print, settings={"controller.kind": "closed_loop_speed"}), "expected one control law, found two"),
        ]
        for arguments, words in wrong:
            with self.assertRaisesRegex(omnibase.Error, words):
                omnibase.Simulation(**arguments)
        robot = omnibase.Simulation(BMM)
        with self.assertRaisesRegex(omnibase.Error, "did you mean `state.pose_x_m`"):
            robot["state.pose_x"]
        with self.assertRaisesRegex(omnibase.Error, "expected one of category_0"):
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
