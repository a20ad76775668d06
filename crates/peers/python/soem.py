"""SOEM (as pysoem) drives a segment of CiA 402 servos: to OP, process data, SDOs of all lengths, dictionary, SYNC0.

Usage: soem.py INTERFACE COUNT
Prints one JSON object; a check that fails ends with exit code 1 and says which.
"""

import json
import sys
import time

import pysoem

from patience import patiently

# Python keeps no cycle time on a busy machine: four frames for each SYNC0, and patience for its pauses.
CYCLE_S = 0.001
SYNC0_S = 0.004
SYNC_ERROR_LIMIT = (500).to_bytes(2, "little")
STATUS_WORD, MODE_OF_OPERATION, PROFILE_VELOCITY = 0x6041, 0x6060, 0x6081
DEVICE_NAME, SCRATCH_MEMORY = 0x1008, 0x2F00


def fail(message):
    print(message, file=sys.stderr)
    sys.exit(1)


def check_sdos(servo):
    """Expedited, normal and segmented transfers, both ways."""
    # 1, 2 and 4 bytes: expedited.
    for index, subindex, values in ((MODE_OF_OPERATION, 0, (b"\x08", b"\x09")), (0x1C32, 1, (b"\x02\x00",)), (PROFILE_VELOCITY, 0, (b"\x10\x27\0\0",))):
        for value in values:
            patiently(servo.sdo_write, index, subindex, value)
            if patiently(servo.sdo_read, index, subindex) != value:
                fail(f"{index:04x}:{subindex:02x} reads back {patiently(servo.sdo_read, index, subindex)}, wrote {value}")
    # A name of more than four bytes: normal. The pattern object: segmented.
    name = patiently(servo.sdo_read, DEVICE_NAME, 0, 64).rstrip(b"\0").decode()
    lengths = {}
    for length in (5, 100, 1000, 4096):
        pattern = bytes((7 * i + length) & 0xFF for i in range(length))
        patiently(servo.sdo_write, SCRATCH_MEMORY, 0, pattern)
        back = patiently(servo.sdo_read, SCRATCH_MEMORY, 0, 8192)
        if back != pattern:
            fail(f"pattern of {length} bytes came back as {len(back)} bytes, different")
        lengths[length] = len(back)
    try:
        patiently(servo.sdo_read, 0x5FFF, 0)
        fail("an object that does not exist was read")
    except pysoem.SdoError as error:
        abort = error.abort_code
    if abort != 0x06020000:
        fail(f"missing object: abort 0x{abort:08x}, expected 0x06020000")
    return name, lengths


def check_dictionary(servo):
    objects = list(servo.od)
    indices = [entry.index for entry in objects]
    if STATUS_WORD not in indices or MODE_OF_OPERATION not in indices:
        fail(f"dictionary of {len(indices)} objects lacks 0x6041 or 0x6060")
    named = next(entry for entry in objects if entry.index == STATUS_WORD)
    return len(indices), str(named.name)


def main():
    interface, count = sys.argv[1], int(sys.argv[2])
    master = pysoem.Master()
    master.open(interface)
    found = master.config_init()
    if found != count:
        fail(f"expected {count} SubDevices, SOEM found {found}")
    names, sdos, dictionary = [], None, None
    for position, servo in enumerate(master.slaves):
        names.append(servo.name)
        if position in (0, count - 1):
            sdos = check_sdos(servo)
        patiently(servo.sdo_write, MODE_OF_OPERATION, 0, b"\x09")
        patiently(servo.sdo_write, 0x1C32, 1, b"\x02\x00")
        patiently(servo.sdo_write, 0x10F1, 2, SYNC_ERROR_LIMIT)
    dictionary = check_dictionary(master.slaves[0])

    # By itself SOEM asks for SAFE-OP while mapping. Here SYNC0 is armed before SAFE-OP, and data flow before SYNC0
    # fires (100 ms later): drives whose sync mode is SYNC0 refuse the one and raise a fault at the other.
    master.manual_state_change = True
    master.config_map()
    master.config_dc()

    def exchange():
        master.send_processdata()
        return master.receive_processdata(20000)

    for servo in master.slaves:
        servo.dc_sync(act=True, sync0_cycle_time=int(SYNC0_S * 1e9))
        exchange()
    master.state = pysoem.SAFEOP_STATE
    master.write_state()
    for _ in range(1000):
        exchange()
        time.sleep(CYCLE_S)
        if master.state_check(pysoem.SAFEOP_STATE, 500) == pysoem.SAFEOP_STATE:
            break
    else:
        master.read_state()
        fail("SAFE-OP not reached: " + str([(s.name, s.state, hex(s.al_status)) for s in master.slaves]))
    for _ in range(200):
        exchange()
        time.sleep(CYCLE_S)
    master.state = pysoem.OP_STATE
    master.write_state()
    for _ in range(400):
        exchange()
        time.sleep(CYCLE_S)
        if master.state_check(pysoem.OP_STATE, 1000) == pysoem.OP_STATE:
            break
    if master.state_check(pysoem.OP_STATE, 50_000) != pysoem.OP_STATE:
        master.read_state()
        fail("OP not reached: " + str([(s.name, s.state, hex(s.al_status), pysoem.al_status_code_to_string(s.al_status)) for s in master.slaves]))

    # Control word 6, 7, 15 must walk the drives through CiA 402 by process data alone.
    states = []
    for word, mask, expected in ((0x06, 0x6F, 0x21), (0x07, 0x6F, 0x23), (0x0F, 0x6F, 0x27)):
        for servo in master.slaves:
            servo.output = word.to_bytes(2, "little") + servo.output[2:]
        wrong = [("no cycle", 0)]
        for _ in range(100):
            counter = exchange()
            time.sleep(CYCLE_S)
            words = [int.from_bytes(servo.input[:2], "little") for servo in master.slaves]
            wrong = [(p, hex(w)) for p, w in enumerate(words) if w & mask != expected]
            if not wrong:
                break
        if wrong:
            fail(f"control word {word:#x}: status words not {expected:#x}: {wrong}")
        states.append(expected)
    short = 0
    for _ in range(200):
        short += exchange() != master.expected_wkc
        time.sleep(CYCLE_S)
    print(json.dumps({
        "subdevices": found, "names": names, "sdo": sdos[1], "dictionary_objects": dictionary[0],
        "states": states, "expected_working_counter": master.expected_wkc, "short_cycles": short,
    }))
    master.state = pysoem.INIT_STATE
    master.write_state()
    master.close()


main()
