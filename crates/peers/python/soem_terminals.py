"""SOEM (as pysoem) brings a segment of terminals and servos to OP, reads an input and sets an output.

Usage: soem_terminals.py INTERFACE COUNT INPUTS OUTPUTS DRIVE... (positions from 0)
Prints one JSON object; a check that fails ends with exit code 1 and says which.
"""

import json
import sys
import time

import pysoem

from patience import patiently

CYCLE_S, SYNC0_S = 0.001, 0.004
SYNC_ERROR_LIMIT = (500).to_bytes(2, "little")


def main():
    interface, count, inputs, outputs, *drives = sys.argv[1:]
    master = pysoem.Master()
    master.open(interface)
    found = master.config_init()
    if found != int(count):
        sys.exit(f"expected {count} SubDevices, SOEM found {found}")
    servos = [master.slaves[int(position)] for position in drives]
    for servo in servos:
        patiently(servo.sdo_write, 0x1C32, 1, b"\x02\x00")
        patiently(servo.sdo_write, 0x10F1, 2, SYNC_ERROR_LIMIT)
    master.manual_state_change = True
    master.config_map()
    master.config_dc()

    def until(state, cycles):
        master.state = state
        master.write_state()
        for _ in range(cycles):
            master.send_processdata()
            master.receive_processdata(20000)
            time.sleep(CYCLE_S)
            if master.state_check(state, 500) == state:
                return
        master.read_state()
        sys.exit(f"state {state} not reached: " + str([(s.name, s.state, hex(s.al_status)) for s in master.slaves]))

    for servo in servos:
        servo.dc_sync(act=True, sync0_cycle_time=int(SYNC0_S * 1e9))
    until(pysoem.SAFEOP_STATE, 1000)
    for _ in range(200):
        master.send_processdata()
        master.receive_processdata(20000)
        time.sleep(CYCLE_S)
    master.slaves[int(outputs)].output = b"\x05"
    until(pysoem.OP_STATE, 1000)
    full = 0
    for _ in range(100):
        master.send_processdata()
        full += master.receive_processdata(20000) == master.expected_wkc
        time.sleep(CYCLE_S)
    master.read_state()
    print(json.dumps({
        "names": [subdevice.name for subdevice in master.slaves],
        "states": [subdevice.state for subdevice in master.slaves],
        "input": master.slaves[int(inputs)].input.hex(),
        "full_cycles": full,
    }))
    master.state = pysoem.INIT_STATE
    master.write_state()
    master.close()


main()
