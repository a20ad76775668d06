"""SOEM (as pysoem) takes a segment to OP and exchanges process data, back to back or at a period.

Usage: soem_cycle.py INTERFACE CONTROL PERIOD_US CYCLES
A period of 0 is back to back; else it sleeps until each cycle is due.
Writes `enable` and `disable` into CONTROL around the cycles that count (see `perf stat --control`), awaits an answer
from CONTROL.ack if there is such a file. Prints CPU time per cycle in ns and the number of wrong cycles, then the
round trips in ns.
"""

import os
import sys
import time

import pysoem

WARM_UP = 200
TIMEOUT_US = 50_000


def main():
    interface, control = sys.argv[1:3]
    period_s, cycles = int(sys.argv[3]) * 1e-6, int(sys.argv[4])
    control_file = os.open(control, os.O_WRONLY)
    answers = os.open(control + ".ack", os.O_RDONLY) if os.path.exists(control + ".ack") else None

    def mark(word):
        os.write(control_file, word)
        if answers is not None:
            os.read(answers, 16)

    master = pysoem.Master()
    master.open(interface)
    master.config_init()
    master.config_map()
    master.config_dc()

    def exchange():
        master.send_processdata()
        return master.receive_processdata(TIMEOUT_US)

    if master.state_check(pysoem.SAFEOP_STATE, 1_000_000) != pysoem.SAFEOP_STATE:
        sys.exit("SAFE-OP not reached")
    exchange()
    master.state = pysoem.OP_STATE
    master.write_state()
    for _ in range(1000):
        exchange()
        time.sleep(0.001)
        if master.state_check(pysoem.OP_STATE, 1000) == pysoem.OP_STATE:
            break
    else:
        sys.exit("OP not reached")

    due = time.monotonic()

    def pace():
        nonlocal due
        if period_s:
            due = max(due + period_s, time.monotonic())
            time.sleep(max(due - time.monotonic(), 0))

    wrong = 0
    round_trips = []
    for _ in range(WARM_UP):
        pace()
        exchange()
    for _ in range(cycles):
        pace()
        start = time.monotonic_ns()
        counter = exchange()
        round_trips.append(time.monotonic_ns() - start)
        wrong += counter != master.expected_wkc
    mark(b"enable\n")
    cpu_ns = time.process_time_ns()
    for _ in range(cycles):
        pace()
        wrong += exchange() != master.expected_wkc
    cpu_ns = time.process_time_ns() - cpu_ns
    mark(b"disable\n")
    print(cpu_ns // cycles, wrong)
    print(*round_trips)


main()
