/*
 * Firmware with a mailbox, built as small SubDevice stacks are: a state machine with checks, an SDO server over a table of
 * objects, and an application (inputs are the outputs plus one). It shows where a stack of one's own is joined: replace what
 * is below "application" by its main loop, and its register access by pdi_read and pdi_write.
 *
 *     cc -std=c99 -O2 -o mailbox_firmware mailbox_firmware.c pdi_client.c
 *     ./mailbox_firmware /tmp/omnibase-one.pdi
 *
 * The chip: SM0 and SM1 mailboxes as the SII says, SM2 four bytes of outputs, SM3 four bytes of inputs.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "pdi_client.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#define AL_CONTROL 0x0120
#define AL_STATUS 0x0130
#define AL_EVENT_MASK 0x0204
#define SYNC_MANAGER(n) (0x0800 + 8 * (n))
#define EVENT_AL_CONTROL (1u << 0)
#define EVENT_SM_CHANGED (1u << 4)
#define EVENT_SM(n) (1u << (8 + (n)))
#define MAILBOX_FULL (1u << 3)
#define MAILBOX_MOST 512u

enum state { INIT = 1, PREOP = 2, SAFEOP = 4, OP = 8 };
enum { ACKNOWLEDGE = 0x10, ERROR = 0x10 };
enum { NO_ERROR = 0, INVALID_CHANGE = 0x11, UNKNOWN_STATE = 0x12, INVALID_MAILBOX = 0x16, INVALID_OUTPUTS = 0x1D, INVALID_INPUTS = 0x1E };
enum { NO_OBJECT = 0x06020000, NO_SUBINDEX = 0x06090011, READ_ONLY = 0x06010002, WRONG_LENGTH = 0x06070010, NO_SERVICE = 0x05040001 };

struct area {
    uint16_t start, length;
    int enabled;
};

struct device {
    struct pdi pdi;
    uint8_t state;
    int error;
    /* SM1's counter, 1 to 7. */
    uint8_t counter;
    uint8_t answer[MAILBOX_MOST];
    uint16_t answer_length;
};

/* --- objects ------------------------------------------------------------------------------------------------------ */

static uint32_t output, input, setting = 42;

struct object {
    uint16_t index;
    uint8_t subindex, bytes, writable;
    uint32_t constant;
    uint32_t *value;
};

static const struct object objects[] = {
    {0x1000, 0, 4, 0, 0x00000191, NULL}, {0x1018, 0, 1, 0, 4, NULL},
    {0x1018, 1, 4, 0, 0x0F0F, NULL},     {0x1018, 2, 4, 0, 0x0402, NULL},
    {0x1018, 3, 4, 0, 0x00010000, NULL}, {0x1018, 4, 4, 0, 0, NULL},
    {0x1600, 0, 1, 0, 1, NULL},          {0x1600, 1, 4, 0, 0x70000120, NULL},
    {0x1A00, 0, 1, 0, 1, NULL},          {0x1A00, 1, 4, 0, 0x60000120, NULL},
    {0x1C12, 0, 1, 0, 1, NULL},          {0x1C12, 1, 2, 0, 0x1600, NULL},
    {0x1C13, 0, 1, 0, 1, NULL},          {0x1C13, 1, 2, 0, 0x1A00, NULL},
    {0x2000, 0, 4, 1, 0, &setting},      {0x6000, 1, 4, 0, 0, &input},
    {0x7000, 1, 4, 0, 0, &output},
};

static const struct object *find(uint16_t index, uint8_t subindex, uint32_t *abort_code) {
    size_t n;
    *abort_code = NO_OBJECT;
    for (n = 0; n < sizeof objects / sizeof objects[0]; n++) {
        if (objects[n].index != index)
            continue;
        *abort_code = NO_SUBINDEX;
        if (objects[n].subindex == subindex)
            return &objects[n];
    }
    return NULL;
}

static void put_u32(uint8_t *to, uint32_t value) {
    int n;
    for (n = 0; n < 4; n++)
        to[n] = (uint8_t)(value >> 8 * n);
}

static uint32_t get_u32(const uint8_t *from) {
    return (uint32_t)from[0] | (uint32_t)from[1] << 8 | (uint32_t)from[2] << 16 | (uint32_t)from[3] << 24;
}

/* --- mailbox: expedited SDOs ---------------------------------------------------------------------------------------- */

/* Answers the SDO request at `request` (behind the CoE header) into `answer`, eight bytes. */
static void serve_sdo(const uint8_t *request, uint8_t *answer) {
    uint16_t index = (uint16_t)(request[1] | request[2] << 8);
    uint32_t abort_code, value;
    const struct object *object = find(index, request[3], &abort_code);
    int unused = request[0] >> 2 & 3;
    memset(answer, 0, 8);
    memcpy(answer + 1, request + 1, 3);
    if (object != NULL && request[0] >> 5 == 2) {
        value = object->value != NULL ? *object->value : object->constant;
        answer[0] = (uint8_t)(0x43 | (4 - object->bytes) << 2);
        put_u32(answer + 4, value);
        return;
    }
    if (object != NULL && request[0] >> 5 == 1) {
        if (!object->writable)
            abort_code = READ_ONLY;
        else if (!(request[0] & 2) || 4 - unused != object->bytes)
            abort_code = WRONG_LENGTH;
        else {
            *object->value = get_u32(request + 4);
            answer[0] = 0x60;
            return;
        }
    } else if (object != NULL)
        abort_code = NO_SERVICE;
    answer[0] = 0x80;
    put_u32(answer + 4, abort_code);
}

static int get_area(struct pdi *pdi, int n, struct area *area) {
    uint8_t registers[8];
    if (pdi_read(pdi, (uint16_t)SYNC_MANAGER(n), registers, sizeof registers) != 0)
        return -1;
    area->start = (uint16_t)(registers[0] | registers[1] << 8);
    area->length = (uint16_t)(registers[2] | registers[3] << 8);
    area->enabled = registers[6] & 1;
    return 0;
}

/* Takes the request out of SM0 and prepares its answer. */
static int receive(struct device *device) {
    uint8_t request[MAILBOX_MOST];
    struct area area;
    if (get_area(&device->pdi, 0, &area) != 0)
        return -1;
    if (area.length > sizeof request || area.length < 16)
        return 0;
    if (pdi_read(&device->pdi, area.start, request, area.length) != 0)
        return -1;
    memset(device->answer, 0, sizeof device->answer);
    device->counter = (uint8_t)(device->counter % 7 + 1);
    device->answer[5] = (uint8_t)(device->counter << 4);
    if ((request[5] & 0x0F) == 3 && request[7] >> 4 == 2) {
        device->answer[0] = 10;
        device->answer[5] |= 3;
        serve_sdo(request + 8, device->answer + 8);
        device->answer[7] = device->answer[8] == 0x80 ? 0x20 : 0x30;
    } else {
        /* Mailbox error reply: the protocol or service isn't there. */
        device->answer[0] = 4;
        device->answer[6] = 1;
        device->answer[8] = 2;
    }
    device->answer_length = 16;
    return 0;
}

/* Puts the answer into SM1 where that is empty. */
static int send(struct device *device) {
    uint8_t status;
    struct area area;
    if (device->answer_length == 0)
        return 0;
    if (pdi_read(&device->pdi, SYNC_MANAGER(1) + 5, &status, 1) != 0 || get_area(&device->pdi, 1, &area) != 0)
        return -1;
    if ((status & MAILBOX_FULL) || area.length > sizeof device->answer)
        return 0;
    device->answer_length = 0;
    return pdi_write(&device->pdi, area.start, device->answer, area.length);
}

/* --- states --------------------------------------------------------------------------------------------------------- */

static int set_status(struct device *device, uint16_t code) {
    uint8_t status[2] = {0, 0}, status_code[2];
    status[0] = (uint8_t)(device->state | (device->error ? ERROR : 0));
    status_code[0] = (uint8_t)code;
    status_code[1] = (uint8_t)(code >> 8);
    /* The code first: whoever sees the error bit finds the reason. */
    return pdi_write(&device->pdi, AL_STATUS + 4, status_code, 2) != 0 || pdi_write(&device->pdi, AL_STATUS, status, 2) != 0 ? -1 : 0;
}

static int check(struct device *device, uint8_t to, uint16_t *code) {
    struct area areas[4];
    int n;
    *code = NO_ERROR;
    if (to != INIT && to != PREOP && to != SAFEOP && to != OP)
        *code = UNKNOWN_STATE;
    else if (to > 2 * device->state)
        *code = INVALID_CHANGE;
    if (*code != NO_ERROR)
        return 0;
    for (n = 0; n < 4; n++)
        if (get_area(&device->pdi, n, &areas[n]) != 0)
            return -1;
    if (to == PREOP && (!areas[0].enabled || !areas[1].enabled))
        *code = INVALID_MAILBOX;
    else if (to == SAFEOP && device->state == PREOP && (!areas[2].enabled || areas[2].length != sizeof output))
        *code = INVALID_OUTPUTS;
    else if (to == SAFEOP && device->state == PREOP && (!areas[3].enabled || areas[3].length != sizeof input))
        *code = INVALID_INPUTS;
    return 0;
}

static int change_state(struct device *device) {
    uint8_t control[2];
    uint16_t code;
    if (pdi_read(&device->pdi, AL_CONTROL, control, sizeof control) != 0)
        return -1;
    if (device->error && !(control[0] & ACKNOWLEDGE))
        return 0;
    device->error = 0;
    if (check(device, control[0] & 0x0F, &code) != 0)
        return -1;
    if (code == NO_ERROR)
        device->state = control[0] & 0x0F;
    else
        device->error = 1;
    if (device->state == INIT)
        device->answer_length = 0;
    return set_status(device, code);
}

/* --- application ---------------------------------------------------------------------------------------------------- */

static int exchange(struct device *device) {
    uint8_t data[4];
    struct area outputs, inputs;
    if (get_area(&device->pdi, 2, &outputs) != 0 || get_area(&device->pdi, 3, &inputs) != 0)
        return -1;
    if (pdi_read(&device->pdi, outputs.start, data, sizeof data) != 0)
        return -1;
    output = device->state == OP ? get_u32(data) : 0;
    input = output + 1;
    put_u32(data, input);
    return pdi_write(&device->pdi, inputs.start, data, sizeof data);
}

static int step(struct device *device) {
    uint32_t event = device->pdi.al_event;
    uint8_t seen = device->state, activation;
    int n;
    if (event & EVENT_SM_CHANGED)
        for (n = 0; n < 4; n++)
            if (pdi_read(&device->pdi, (uint16_t)(SYNC_MANAGER(n) + 6), &activation, 1) != 0)
                return -1;
    if ((event & EVENT_AL_CONTROL) && change_state(device) != 0)
        return -1;
    if (device->state >= PREOP && (event & EVENT_SM(0)) && device->answer_length == 0 && receive(device) != 0)
        return -1;
    if (device->state >= PREOP && send(device) != 0)
        return -1;
    if (device->state >= SAFEOP && (seen != device->state || (event & EVENT_SM(2))) && exchange(device) != 0)
        return -1;
    return 0;
}

int main(int argc, char **argv) {
    struct device device;
    uint8_t mask[4] = {0x11, 0x07, 0, 0};
    if (argc != 2) {
        fprintf(stderr, "usage: %s <socket>\n", argv[0]);
        return 2;
    }
    memset(&device, 0, sizeof device);
    if (pdi_connect(&device.pdi, argv[1]) != 0) {
        if (errno == ECONNRESET)
            fprintf(stderr, "%s: another firmware is connected there\n", argv[1]);
        else
            perror(argv[1]);
        return 1;
    }
    do {
        if (device.pdi.power_on) {
            device.pdi.power_on = 0;
            device.state = INIT;
            device.error = 0;
            device.answer_length = 0;
            if (set_status(&device, NO_ERROR) != 0 || pdi_write(&device.pdi, AL_EVENT_MASK, mask, sizeof mask) != 0)
                break;
        }
        if (step(&device) != 0)
            break;
    } while (pdi_yield(&device.pdi, PDI_FOREVER) == 0);
    pdi_close(&device.pdi);
    return 0;
}
