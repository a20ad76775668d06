"""What is at a bus, objects and an exchange: on a simulated segment in the process, and over a virtual cable."""

import os
import signal
import subprocess
import threading
import time
import unittest

import omnibase
from places import BMM, PROGRAM, ROOT

SEGMENT = ROOT / "segments/three-sgdv.toml"
SIM = f"sim:{SEGMENT}"
NEAR, FAR = "veth0", "veth1"


def command_line(*arguments):
    """What a command says on its standard error."""
    run = subprocess.run([PROGRAM, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True)
    return run.stderr.strip().removeprefix("error: ")


class InTheProcess(unittest.TestCase):
    def test_a_scan_tells_what_the_command_line_tells(self):
        found = omnibase.scan(SIM)
        self.assertEqual([one["vendor_id"] for one in found], [0x539] * 3)
        self.assertEqual(found[1]["state"], "PRE-OP")
        self.assertNotIn("dictionary", found[0])
        names = {entry["name"] for entry in omnibase.scan(SIM, dictionary=True)[1]["dictionary"]}
        self.assertIn("Statusword", names)

    def test_objects_have_the_types_of_the_dictionary(self):
        self.assertEqual(omnibase.sdo_read(SIM, 0, "1008:0"), "SGDV-OCA01A")
        self.assertEqual(omnibase.sdo_read(SIM, 0, "6064:0"), 524_288)
        self.assertEqual(omnibase.sdo_read(SIM, 0, "6064:0", type="hex"), bytes([0, 0, 8, 0]))
        omnibase.sdo_write(SIM, 2, "607a:0", -5)
        omnibase.sdo_write(SIM, 2, "6060:0", bytes([8]))

    def test_refusals_are_those_of_the_command_line(self):
        for call, command in [
            (lambda: omnibase.scan("sim:nowhere.toml"), ["scan", "sim:nowhere.toml"]),
            (lambda: omnibase.sdo_read(SIM, 0, "6041:7"), ["sdo", "read", SIM, "0", "6041:7"]),
            (lambda: omnibase.sdo_write(SIM, 0, "6060:0", 300), ["sdo", "write", SIM, "0", "6060:0", "300"]),
            (lambda: omnibase.sdo_read(SIM, 9, "6041:0"), ["sdo", "read", SIM, "9", "6041:0"]),
        ]:
            with self.assertRaises(omnibase.Error) as raised:
                call()
            self.assertEqual(str(raised.exception), command_line(*command))
        for wrong in (dict(target=""), dict(target="@robots")):
            with self.assertRaises(omnibase.Error):
                omnibase.scan(**wrong)
        with self.assertRaisesRegex(omnibase.Error, "cycle_us: expected microseconds from 10 to 100000"):
            omnibase.exchange(SIM, cycle_us=float("nan"))

    def test_an_exchange_reaches_op_and_tells_its_figures(self):
        told = omnibase.exchange(SIM, cycles=500, dc=True)
        self.assertEqual((told["cycles"], told["operational"], told["lost_frames"]), (500, True, 0))

    def test_ctrl_c_ends_an_exchange(self):
        # Whoever started the tests may have it ignored.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, before)
        pressed = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
        pressed.start()
        with self.assertRaises(KeyboardInterrupt):
            omnibase.exchange(SIM, cycles=10**12)
        self.assertEqual(omnibase.exchange(SIM, cycles=10)["cycles"], 10)


@unittest.skipUnless("OMNIBASE_CABLE" in os.environ, "no rights for a virtual cable")
class OverACable(unittest.TestCase):
    def started(self, *arguments, until):
        run = subprocess.Popen([PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.addCleanup(lambda: (run.kill(), run.wait(), run.stdout.close()))
        for line in run.stdout:
            if until in line:
                threading.Thread(target=run.stdout.read, daemon=True).start()
                return run
        self.fail(f"never said `{until}`")

    def test_a_segment_answers_while_other_threads_go_on(self):
        self.started("simulate", SEGMENT, "--interface", FAR, until="Ctrl-C ends")
        self.assertEqual(len(omnibase.scan(NEAR)), 3)
        self.assertEqual(omnibase.sdo_read(NEAR, 2, "1008:0"), "SGDV-OCA01A")
        omnibase.sdo_write(NEAR, 0, "607a:0", 1234)
        self.assertEqual(omnibase.sdo_read(NEAR, 0, "607a:0"), 1234)
        ended, told, counted = threading.Event(), [], 0

        def exchanges():
            # Whoever is kept waiting for longer than a watchdog has lost OP by the end, as it shall be.
            until = time.monotonic() + 60
            while not (told and told[-1]["operational"]) and time.monotonic() < until:
                told.append(omnibase.exchange(NEAR, cycles=100, cycle_us=5000))
            ended.set()

        thread = threading.Thread(target=exchanges)
        thread.start()
        while not ended.is_set():
            counted += 1
            time.sleep(0.001)
        thread.join()
        self.assertEqual((told[-1]["cycles"], told[-1]["operational"]), (100, True))
        self.assertGreater(counted, 50)

    def test_a_running_robots_interface_is_refused_and_the_robot_answers_itself(self):
        self.started("simulate", BMM, "--interface", FAR, until="Ctrl-C ends")
        patient = [
            "bus.cycle_us=4000", "bus.receive_timeout_us=3800", "bus.synchronisation=sync_manager_event",
            "safety.lost_exchanges_tolerated=250", "safety.drive_watchdog_us=1500000",
        ]
        sets = [word for setting in patient for word in ("--set", setting)]
        self.started("run", BMM, "--interface", NEAR, "--dashboard=127.0.0.1:0", *sets, until="dashboard: http://")
        for call, command in [
            (lambda: omnibase.scan(NEAR), ["scan", NEAR]),
            (lambda: omnibase.sdo_read(NEAR, 0, "6041:0"), ["sdo", "read", NEAR, "0", "6041:0"]),
            (lambda: omnibase.exchange(NEAR), ["exchange", NEAR]),
        ]:
            with self.assertRaisesRegex(omnibase.Error, "omnibase scan @robot") as raised:
                call()
            self.assertEqual(str(raised.exception), command_line(*command))
        self.assertEqual(len(self.once_in_op(lambda: omnibase.scan("@robot"))), 3)
        self.assertIsInstance(self.once_in_op(lambda: omnibase.sdo_read("@robot", 0, "6041:0")), int)

    def once_in_op(self, ask):
        """What a robot answers that is on its way to OP, or on its way back on a machine that kept it waiting; nothing before it knows
        its segment."""
        until = time.monotonic() + 60
        while True:
            try:
                if answer := ask():
                    return answer
            except omnibase.Error:
                pass
            self.assertLess(time.monotonic(), until)
            time.sleep(0.1)
