/*
 * Client of the PDI socket (docs/pdi-socket.md).
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#define _POSIX_C_SOURCE 200112L

#include "pdi_client.h"

#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <sys/un.h>
#include <unistd.h>

#define HEADER 8u
#define EVENT_WORD 4u

enum { READ = 0x01, WRITE = 0x02, YIELD = 0x03, READ_ANSWER = 0x81, WRITE_ANSWER = 0x82, EVENT = 0x83, POWER_ON = 0x84 };

static uint16_t get16(const uint8_t *bytes) {
    return (uint16_t)(bytes[0] | (uint16_t)bytes[1] << 8);
}

static uint32_t get32(const uint8_t *bytes) {
    return get16(bytes) | (uint32_t)get16(bytes + 2) << 16;
}

static uint64_t get64(const uint8_t *bytes) {
    return get32(bytes) | (uint64_t)get32(bytes + 4) << 32;
}

static void put16(uint8_t *bytes, uint16_t value) {
    bytes[0] = (uint8_t)value;
    bytes[1] = (uint8_t)(value >> 8);
}

static int send_all(int socket, const uint8_t *bytes, size_t length) {
    while (length > 0) {
        ssize_t sent = write(socket, bytes, length);
        if (sent < 0 && errno == EINTR)
            continue;
        if (sent <= 0)
            return -1;
        bytes += sent;
        length -= (size_t)sent;
    }
    return 0;
}

static int receive_all(int socket, uint8_t *bytes, size_t length) {
    while (length > 0) {
        ssize_t received = read(socket, bytes, length);
        if (received < 0 && errno == EINTR)
            continue;
        if (received == 0)
            errno = ECONNRESET;
        if (received <= 0)
            return -1;
        bytes += received;
        length -= (size_t)received;
    }
    return 0;
}

/* Header and data in one go: a message is never split by another one. */
static int request(struct pdi *pdi, uint8_t kind, uint16_t address, uint16_t length, const void *data, size_t data_length) {
    uint8_t message[HEADER + PDI_MAX_LENGTH] = {0};
    message[0] = kind;
    put16(message + 2, address);
    put16(message + 4, length);
    if (data_length > 0)
        memcpy(message + HEADER, data, data_length);
    return send_all(pdi->socket, message, HEADER + data_length);
}

/* Receives one message; its data goes to `data` if it is an answer to a read. Returns its kind, or -1. */
static int receive(struct pdi *pdi, void *data, uint16_t length) {
    uint8_t header[HEADER + EVENT_WORD], time[8];
    uint16_t follows;
    if (receive_all(pdi->socket, header, sizeof header) != 0)
        return -1;
    follows = get16(header + 4);
    pdi->al_event = get32(header + HEADER);
    switch (header[0]) {
    case READ_ANSWER:
        if (follows != length || data == NULL)
            break;
        return receive_all(pdi->socket, data, follows) == 0 ? READ_ANSWER : -1;
    case WRITE_ANSWER:
        return WRITE_ANSWER;
    case EVENT:
    case POWER_ON:
        if (follows != sizeof time || receive_all(pdi->socket, time, sizeof time) != 0)
            break;
        pdi->now_ns = get64(time);
        if (header[0] == POWER_ON)
            pdi->power_on = 1;
        else
            pdi->event_pending = 1;
        return header[0];
    default:
        break;
    }
    errno = EPROTO;
    return -1;
}

/* Receives until an answer of this kind came; events in between are noted. */
static int await(struct pdi *pdi, int kind, void *data, uint16_t length) {
    for (;;) {
        int received = receive(pdi, data, length);
        if (received == kind)
            return 0;
        if (received != EVENT && received != POWER_ON)
            return -1;
    }
}

int pdi_connect(struct pdi *pdi, const char *path) {
    struct sockaddr_un address;
    memset(pdi, 0, sizeof *pdi);
    memset(&address, 0, sizeof address);
    address.sun_family = AF_UNIX;
    if (strlen(path) >= sizeof address.sun_path) {
        errno = ENAMETOOLONG;
        return -1;
    }
    strcpy(address.sun_path, path);
    pdi->socket = socket(AF_UNIX, SOCK_STREAM, 0);
    if (pdi->socket < 0)
        return -1;
    if (connect(pdi->socket, (struct sockaddr *)&address, sizeof address) != 0 || await(pdi, POWER_ON, NULL, 0) != 0) {
        pdi_close(pdi);
        return -1;
    }
    return 0;
}

int pdi_read(struct pdi *pdi, uint16_t address, void *data, uint16_t length) {
    if (length > PDI_MAX_LENGTH) {
        errno = EMSGSIZE;
        return -1;
    }
    if (request(pdi, READ, address, length, NULL, 0) != 0)
        return -1;
    return await(pdi, READ_ANSWER, data, length);
}

int pdi_write(struct pdi *pdi, uint16_t address, const void *data, uint16_t length) {
    if (length > PDI_MAX_LENGTH) {
        errno = EMSGSIZE;
        return -1;
    }
    if (request(pdi, WRITE, address, length, data, length) != 0)
        return -1;
    return await(pdi, WRITE_ANSWER, NULL, 0);
}

int pdi_yield(struct pdi *pdi, uint64_t max_wait_ns) {
    uint8_t wait[8];
    int i;
    for (i = 0; i < 8; i++)
        wait[i] = (uint8_t)(max_wait_ns >> (8 * i));
    if (request(pdi, YIELD, 0, sizeof wait, wait, sizeof wait) != 0)
        return -1;
    while (!pdi->event_pending && !pdi->power_on) {
        int received = receive(pdi, NULL, 0);
        if (received != EVENT && received != POWER_ON)
            return -1;
    }
    pdi->event_pending = 0;
    return 0;
}

void pdi_close(struct pdi *pdi) {
    int error = errno;
    close(pdi->socket);
    pdi->socket = -1;
    errno = error;
}
