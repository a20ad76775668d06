"""What was recorded of a run, as numpy and pandas have it."""

import subprocess
import unittest

import numpy as np
import omnibase
from places import BMM, FOLDER, PROGRAM


class Recordings(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.file = FOLDER / "run.mcap"
        command = [PROGRAM, "run", BMM, "--circle", "radius_m=0.3,duration_s=6", "--record", cls.file]
        subprocess.run(command, check=True, capture_output=True)

    def test_signals_are_arrays_by_their_names(self):
        run = omnibase.Recording(self.file)
        x, y = run["truth.pose_x_m"], run["truth.pose_y_m"]
        self.assertEqual((x.shape, x.dtype), ((len(run),), np.float64))
        # The circle begins where the robot stands, and is 0.6 m across.
        self.assertAlmostEqual(max(np.ptp(x), np.ptp(y)), 0.6, delta=0.01)
        self.assertEqual(run.values(["truth.pose_*_m"]).shape, (len(run), 2))
        np.testing.assert_allclose(np.diff(run.times_s), 1e-3, atol=1e-9)
        self.assertIn("robot.toml", "".join(run.description))
        self.assertIsNone(run.truncated)
        self.assertTrue(all(isinstance(words, str) for _, words in run.events) and run.events)

    def test_pandas_has_a_table_by_time(self):
        run = omnibase.Recording(self.file)
        table = run.to_pandas(["state.pose_*", "wheel_1.speed_rad_s"])
        self.assertEqual(table.index.name, "time_s")
        self.assertEqual(len(table), len(run))
        np.testing.assert_array_equal(table["state.pose_x_m"].to_numpy(), run["state.pose_x_m"])
        self.assertEqual(list(run.to_pandas().columns), run.signals)

    def test_a_file_that_is_cut_off_is_read_as_far_as_it_goes(self):
        cut = FOLDER / "cut.mcap"
        whole = self.file.read_bytes()
        cut.write_bytes(whole[: len(whole) // 2])
        run = omnibase.Recording(cut)
        self.assertTrue(0 < len(run) < len(omnibase.Recording(self.file)))
        self.assertIn("breaks off", run.truncated)

    def test_mistakes_are_told(self):
        with self.assertRaisesRegex(omnibase.Error, "nowhere.mcap: No such file"):
            omnibase.Recording("nowhere.mcap")
        with self.assertRaisesRegex(omnibase.Error, "bmm.toml: .*MCAP"):
            omnibase.Recording(BMM)
        with self.assertRaisesRegex(omnibase.Error, "did you mean `state.pose_x_m`"):
            omnibase.Recording(self.file)["state.pose_x"]
