"""SOEM (as pysoem) writes an alias into the EEPROM of the first SubDevice and a firmware into its flash, and reads both back.

Usage: soem_field.py INTERFACE ALIAS FIRMWARE (bytes in hexadecimal; nothing: no firmware)
Prints one JSON object; a check that fails ends with exit code 1 and says which.
"""

import json
import sys

import pysoem

TIMEOUT_US = 1_000_000
# Words of an EEPROM: the alias, the checksum over the seven words before it, mailboxes in BOOT (offset and size, out and in).
ALIAS, CHECKSUM, BOOT_MAILBOXES = 4, 7, 0x14
FIXED_WORDS = 64


def checksum(data):
    """CRC-8 of polynomial x^8 + x^2 + x + 1, from 0xFF."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x07 if crc & 0x80 else 0)) & 0xFF
    return crc


def main():
    interface, alias, firmware = sys.argv[1], int(sys.argv[2]), bytes.fromhex(sys.argv[3])
    master = pysoem.Master()
    master.open(interface)
    master.config_init()
    subdevice = master.slaves[0]

    def word(address):
        return subdevice.eeprom_read(address, TIMEOUT_US)[:2]

    def state(wanted):
        subdevice.state = wanted
        subdevice.write_state()
        found = subdevice.state_check(wanted, TIMEOUT_US)
        if found != wanted:
            sys.exit(f"state {wanted} not reached, but {found}, AL status {subdevice.al_status:#x}")

    before = b"".join(word(address) for address in range(FIXED_WORDS))
    head = before[: 2 * ALIAS] + alias.to_bytes(2, "little") + before[2 * ALIAS + 2 : 2 * CHECKSUM]
    subdevice.eeprom_write(ALIAS, alias.to_bytes(2, "little"), TIMEOUT_US)
    subdevice.eeprom_write(CHECKSUM, bytes([checksum(head), 0]), TIMEOUT_US)
    after = b"".join(word(address) for address in range(FIXED_WORDS))
    if after[: 2 * CHECKSUM + 2] != head + bytes([checksum(head), 0]):
        sys.exit(f"the EEPROM reads back {after.hex()}")

    read_back = b""
    if firmware:
        state(pysoem.INIT_STATE)
        at = 2 * BOOT_MAILBOXES
        out_start, out_size, in_start, in_size = (
            int.from_bytes(after[at + 2 * n : at + 2 * n + 2], "little") for n in range(4)
        )
        subdevice.amend_mbx("out", out_start, out_size)
        subdevice.amend_mbx("in", in_start, in_size)
        state(pysoem.BOOT_STATE)
        subdevice.foe_write("firmware.bin", 0, firmware, TIMEOUT_US)
        read_back = subdevice.foe_read("firmware.bin", 0, 2 * len(firmware), TIMEOUT_US)
    state(pysoem.INIT_STATE)
    master.close()
    print(json.dumps({"before": before.hex(), "after": after.hex(), "firmware": bytes(read_back).hex()}))


main()
