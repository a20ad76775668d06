"""SOEM (as pysoem) brings a segment to OP, with commands that the SubDevices' makers want sent in PRE-OP.

Usage: soem_esi.py INTERFACE COMMANDS (a JSON list of [position, index, subindex, bytes in hexadecimal])
Prints one JSON object; a check that fails ends with exit code 1 and says which.
"""

import json
import sys
import time

import pysoem

from patience import patiently

CYCLE_S = 0.001


def main():
    interface, commands = sys.argv[1], json.loads(sys.argv[2])
    master = pysoem.Master()
    master.open(interface)
    found = master.config_init()
    for position, index, subindex, data in commands:
        data = bytes.fromhex(data)
        subdevice = master.slaves[position]
        patiently(subdevice.sdo_write, index, subindex, data)
        back = patiently(subdevice.sdo_read, index, subindex)
        if back != data:
            sys.exit(f"SubDevice {position}: {index:04x}:{subindex:02x} was written {data.hex()} and reads back {back.hex()}")
    master.config_map()
    master.config_dc()

    def until(state):
        master.state = state
        master.write_state()
        for _ in range(2000):
            master.send_processdata()
            master.receive_processdata(20000)
            time.sleep(CYCLE_S)
            if master.state_check(state, 500) == state:
                return
        master.read_state()
        sys.exit(f"state {state} not reached: " + str([(s.name, s.state, hex(s.al_status)) for s in master.slaves if s.state != state]))

    until(pysoem.SAFEOP_STATE)
    until(pysoem.OP_STATE)
    full = 0
    for _ in range(50):
        master.send_processdata()
        full += master.receive_processdata(20000) == master.expected_wkc
        time.sleep(CYCLE_S)
    master.read_state()
    print(json.dumps({
        "subdevices": found,
        "operational": sum(s.state == pysoem.OP_STATE for s in master.slaves),
        "commands": len(commands),
        "full_cycles": full,
        "input_bytes": sum(len(s.input) for s in master.slaves),
        "output_bytes": sum(len(s.output) for s in master.slaves),
    }))
    master.state = pysoem.INIT_STATE
    master.write_state()
    master.close()


main()
