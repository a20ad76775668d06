/*
 * Client of the PDI socket: gives firmware the registers and memory of a simulated ESC (docs/pdi-socket.md).
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef OMNIBASE_PDI_CLIENT_H
#define OMNIBASE_PDI_CLIENT_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes that one read or write may have at most. */
#define PDI_MAX_LENGTH 4096u
/* For pdi_yield: only an event ends it. */
#define PDI_FOREVER UINT64_MAX

/* A connection. Zero-initialisation isn't needed: pdi_connect sets everything. */
struct pdi {
    int socket;
    /* AL event word (register 0x0220) as the last answer gave it. */
    uint32_t al_event;
    /* Simulated time of the last event, ns. */
    uint64_t now_ns;
    /* Set when the SubDevice got power (also after connecting); the firmware clears it when it has started over. */
    int power_on;
    /* Set when an event came that pdi_yield hasn't returned yet. */
    int event_pending;
};

/* All functions return 0, or -1 when the connection is gone or can't be made (errno says why). */

/* Connects to the socket at `path` and waits for the power-on message. ECONNRESET: another firmware is connected there. */
int pdi_connect(struct pdi *pdi, const char *path);

/* Reads `length` bytes of registers or memory from `address` on. */
int pdi_read(struct pdi *pdi, uint16_t address, void *data, uint16_t length);

/* Writes `length` bytes from `address` on. */
int pdi_write(struct pdi *pdi, uint16_t address, const void *data, uint16_t length);

/* Nothing to do: waits for an event, a power-on, or until `max_wait_ns` of simulated time have passed. */
int pdi_yield(struct pdi *pdi, uint64_t max_wait_ns);

/* Ends the connection. */
void pdi_close(struct pdi *pdi);

#ifdef __cplusplus
}
#endif

#endif
