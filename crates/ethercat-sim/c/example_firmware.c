/*
 * Firmware without a mailbox: goes to OP and copies its outputs to its inputs.
 *
 *     cc -std=c99 -o example_firmware example_firmware.c pdi_client.c
 *     ./example_firmware /tmp/subdevice-0.pdi
 *
 * The MainDevice puts outputs into SyncManager 2 and inputs into SyncManager 3; their lengths must be equal.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "pdi_client.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#define AL_CONTROL 0x0120
#define AL_STATUS 0x0130
#define SYNC_MANAGER(n) (0x0800 + 8 * (n))
#define EVENT_AL_CONTROL (1u << 0)
#define EVENT_SM_CHANGED (1u << 4)
#define EVENT_OUTPUTS (1u << (8 + 2))

enum state { INIT = 1, PREOP = 2, SAFEOP = 4, OP = 8 };
enum { ACKNOWLEDGE = 0x10, ERROR = 0x10 };
enum { NO_ERROR = 0, INVALID_STATE_CHANGE = 0x0011, UNKNOWN_STATE = 0x0012, INVALID_OUTPUTS = 0x001D, INVALID_INPUTS = 0x001E };

struct area {
    uint16_t start, length;
    int enabled;
};

static int get_area(struct pdi *pdi, int n, struct area *area) {
    uint8_t registers[8];
    if (pdi_read(pdi, (uint16_t)SYNC_MANAGER(n), registers, sizeof registers) != 0)
        return -1;
    area->start = (uint16_t)(registers[0] | registers[1] << 8);
    area->length = (uint16_t)(registers[2] | registers[3] << 8);
    area->enabled = registers[6] & 1;
    return 0;
}

static int set_status(struct pdi *pdi, uint8_t state, uint16_t code) {
    uint8_t status[2] = {0, 0}, status_code[2];
    status[0] = state;
    status_code[0] = (uint8_t)code;
    status_code[1] = (uint8_t)(code >> 8);
    /* The code first: whoever sees the error bit finds the reason. */
    return pdi_write(pdi, AL_STATUS + 4, status_code, 2) != 0 || pdi_write(pdi, AL_STATUS, status, 2) != 0 ? -1 : 0;
}

/* What forbids to go from `from` to `to`; NO_ERROR if nothing does. */
static int check(struct pdi *pdi, uint8_t from, uint8_t to, uint16_t *code) {
    struct area outputs, inputs;
    *code = NO_ERROR;
    if (to != INIT && to != PREOP && to != SAFEOP && to != OP)
        *code = UNKNOWN_STATE;
    else if (to > 2 * from)
        *code = INVALID_STATE_CHANGE;
    if (*code != NO_ERROR || from != PREOP || to != SAFEOP)
        return 0;
    if (get_area(pdi, 2, &outputs) != 0 || get_area(pdi, 3, &inputs) != 0)
        return -1;
    if (!outputs.enabled || outputs.length == 0 || outputs.length > PDI_MAX_LENGTH)
        *code = INVALID_OUTPUTS;
    else if (!inputs.enabled || inputs.length != outputs.length)
        *code = INVALID_INPUTS;
    return 0;
}

static int change_state(struct pdi *pdi, uint8_t *state, int *error) {
    uint8_t control[2];
    uint16_t code;
    if (pdi_read(pdi, AL_CONTROL, control, sizeof control) != 0)
        return -1;
    if (*error && !(control[0] & ACKNOWLEDGE))
        return 0;
    *error = 0;
    if (check(pdi, *state, control[0] & 0x0F, &code) != 0)
        return -1;
    if (code != NO_ERROR) {
        *error = 1;
        return set_status(pdi, *state | ERROR, code);
    }
    *state = control[0] & 0x0F;
    return set_status(pdi, *state, NO_ERROR);
}

static int copy(struct pdi *pdi, uint8_t state) {
    static uint8_t data[PDI_MAX_LENGTH];
    struct area outputs, inputs;
    if (get_area(pdi, 2, &outputs) != 0 || get_area(pdi, 3, &inputs) != 0)
        return -1;
    if (outputs.length > sizeof data || inputs.length > sizeof data)
        return 0;
    memset(data, 0, sizeof data);
    if (pdi_read(pdi, outputs.start, data, outputs.length) != 0)
        return -1;
    if (state != OP)
        memset(data, 0, sizeof data);
    return pdi_write(pdi, inputs.start, data, inputs.length);
}

int main(int argc, char **argv) {
    struct pdi pdi;
    uint8_t state = INIT, seen, activation;
    int error = 0, n;
    if (argc != 2) {
        fprintf(stderr, "usage: %s <socket>\n", argv[0]);
        return 2;
    }
    if (pdi_connect(&pdi, argv[1]) != 0) {
        if (errno == ECONNRESET)
            fprintf(stderr, "%s: another firmware is connected there\n", argv[1]);
        else
            perror(argv[1]);
        return 1;
    }
    for (;;) {
        if (pdi.power_on) {
            pdi.power_on = 0;
            state = INIT;
            error = 0;
        }
        if (pdi.al_event & EVENT_SM_CHANGED)
            for (n = 2; n <= 3; n++)
                if (pdi_read(&pdi, (uint16_t)(SYNC_MANAGER(n) + 6), &activation, 1) != 0)
                    goto gone;
        seen = state;
        if ((pdi.al_event & EVENT_AL_CONTROL) && change_state(&pdi, &state, &error) != 0)
            goto gone;
        /* Inputs are valid from SAFE-OP on. */
        if (state >= SAFEOP && (seen != state || (pdi.al_event & EVENT_OUTPUTS)) && copy(&pdi, state) != 0)
            goto gone;
        if (pdi_yield(&pdi, PDI_FOREVER) != 0)
            goto gone;
    }
gone:
    pdi_close(&pdi);
    return 0;
}
