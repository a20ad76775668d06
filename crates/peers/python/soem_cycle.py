"""SOEM (as pysoem) takes a segment to OP and exchanges process data, back to back, as fast as it can.

Usage: soem_cycle.py INTERFACE CYCLES CONTROL
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
    interface, cycles, control = sys.argv[1], int(sys.argv[2]), sys.argv[3]
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

    wrong = 0
    round_trips = []
    for _ in range(WARM_UP):
        exchange()
    for _ in range(cycles):
        start = time.monotonic_ns()
        counter = exchange()
        round_trips.append(time.monotonic_ns() - start)
        wrong += counter != master.expected_wkc
    mark(b"enable\n")
    cpu_ns = time.process_time_ns()
    for _ in range(cycles):
        wrong += exchange() != master.expected_wkc
    cpu_ns = time.process_time_ns() - cpu_ns
    mark(b"disable\n")
    print(cpu_ns // cycles, wrong)
    print(*round_trips)


main()
