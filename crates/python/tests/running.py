"""A robot that runs in a process of its own, driven from Python."""

import math
import os
import subprocess
import time
import unittest

import numpy as np
import omnibase
from places import BMM, FOLDER, PROGRAM


class Running(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        environment = dict(os.environ, OMNIBASE_TOKEN="token-of-the-test")
        file = FOLDER / "robot.toml"
        # However busy the machine is: the age of commands is tested elsewhere.
        file.write_text(BMM.read_text() + "\n[safety]\ncommand_age_ms = 5000\n")
        command = [PROGRAM, "run", file, "--simulated", "--dashboard=127.0.0.1:0", "--paths", FOLDER]
        cls.run_ = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        for line in cls.run_.stderr:
            if line.startswith("dashboard: http://"):
                cls.address = line.split("/")[2]
                break

    @classmethod
    def tearDownClass(cls):
        cls.run_.kill()
        cls.run_.wait()
        cls.run_.stderr.close()

    def test_it_is_found_driven_and_seen(self):
        robot = omnibase.Robot()
        with self.assertRaises(omnibase.Refused):
            robot.call("go_to", pose=[0.2, 0.0, 0.0])
        robot.call("enable")
        signals = omnibase.Signals(["state.*"], address=self.address, token="token-of-the-test")
        self.assertIn("state.pose_x_m", signals.names)
        seen_s, most = [], 0.0
        begun = time.monotonic()
        while most < 0.15 or len(seen_s) < 500:
            self.assertLess(time.monotonic() - begun, 30.0, f"{most} m/s after {len(seen_s)} rows")
            if robot.status()["phase"] in ("holding", "tracking"):
                robot.drive(0.2, 0.0, 0.0)
            times, values = signals.rows(0.05)
            self.assertEqual(values.shape, (len(times), len(signals.names)))
            seen_s += list(times)
            if len(times):
                most = max(most, values[:, signals.names.index("state.twist_in_body_x_m_s")].max())
        # On the grid of the robot's cycles, and none twice; a busy machine leaves some out.
        cycles = np.diff(seen_s) / (1e-3 * signals.cycle_ms)
        np.testing.assert_allclose(cycles, np.round(cycles), atol=1e-5)
        self.assertGreater(cycles.min(), 0.5)
        robot.let_go()
        while robot.status()["phase"] != "holding":
            self.assertLess(time.monotonic() - begun, 40.0)
        robot.call("stop", category="category_1")

    def test_mistakes_are_told(self):
        with self.assertRaisesRegex(omnibase.Refused, "token"):
            omnibase.Robot(self.address, "wrong")
        with self.assertRaisesRegex(omnibase.Error, "expected <address>:<port>, found `here`"):
            omnibase.Robot("here")
        robot = omnibase.Robot(self.address, "token-of-the-test")
        with self.assertRaisesRegex(omnibase.Error, "timeout_s: expected a time, found NaN"):
            robot.status(math.nan)
        with self.assertRaises(omnibase.Error):
            robot.call("fly")
