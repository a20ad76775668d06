"""SOEM waits 20 ms for a mailbox's frame; a busy machine may be later than that."""

import pysoem

TIMES = 50


def patiently(ask, *what):
    """What `ask` gives of `what`; asked again where SOEM heard nothing in its time."""
    for _ in range(TIMES):
        try:
            return ask(*what)
        except pysoem.WkcError:
            pass
    return ask(*what)
