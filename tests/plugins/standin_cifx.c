/* standin_cifx.c: stands in for the cifX driver's library, for the tests.
 *
 * The stand-in has two boards, cifX0 and cifX1, whose process images are joined: each reads the other one's output. Each bus
 * communicates while both are on. An image that the other end has not read yet is EXCHANGE_FAILED for its writer, one
 * that it has read already for its reader.
 */
#include "standin.h"

enum { INVALID_BOARD = 0x800A0002, INVALID_ACCESS_SIZE = 0x800A0008, NO_COM = 0x800C0021, FAILED = 0x800C0022 };
enum { IMAGE = 512 };

#ifndef WITHOUT_START
struct init {
    int options;
    const char *base;
    unsigned long interval;
    int priority;
    unsigned long trace;
    int count;
    void *cards;
    int number, locking, stack, policy;
    FILE *log;
};
#endif

struct end {
    int is_on, is_full;
    uint8_t image[IMAGE];
};
static struct end ends[2];
static int driver;

#define CALLED(...)                      \
    long code;                           \
    if (called(&code, __func__, __VA_ARGS__) && code != (int32_t)NO_COM) \
    return (int32_t)code

static struct end *other(struct end *end) {
    return &ends[end == &ends[0]];
}

#ifndef WITHOUT_START
int32_t cifXDriverInit(const struct init *init) {
    CALLED("%d, %s, %lu", init->options,
           init->base || init->cards || init->count || init->log ? "wrong" : "defaults", init->interval + init->trace);
    return 0;
}

void cifXDriverDeinit(void) {
    long code;
    called(&code, __func__, "");
}
#endif

int32_t xDriverOpen(void **handle) {
    CALLED("");
    *handle = &driver;
    return 0;
}

int32_t xDriverClose(void *handle) {
    CALLED("%s", handle == &driver ? "driver" : "wrong");
    return 0;
}

int32_t xChannelOpen(void *handle, char *board, uint32_t channel, void **result) {
    CALLED("%s, %s, %u", handle == &driver ? "driver" : "wrong", board, channel);
    if (strcmp(board, "cifX0") != 0 && strcmp(board, "cifX1") != 0)
        return (int32_t)INVALID_BOARD;
    *result = &ends[board[4] - '0'];
    return 0;
}

int32_t xChannelClose(void *handle) {
    CALLED("%d", (int)((struct end *)handle - ends));
    return 0;
}

static void put(uint8_t *at, uint32_t value, int bytes) {
    memcpy(at, &value, (size_t)bytes); /* this computer's order; the tests run on little-endian ones */
}

int32_t xChannelInfo(void *handle, uint32_t size, void *data) {
    uint8_t *info = data;
    CALLED("%d, %u", (int)((struct end *)handle - ends), size);
    memset(info, 0, size);
    strcpy((char *)info, "cifX0");
    put(info + 36, 20123, 4);
    put(info + 40, 2, 2);
    put(info + 42, 7, 2);
    info[48] = 13;
    memcpy(info + 49, "PROFIBUS DPS?", 13);
    put(info + size - 4, 0x07, 4);
    return 0;
}

int32_t xChannelHostState(void *handle, uint32_t command, uint32_t *state, uint32_t timeout) {
    CALLED("%d, %u, %u", (int)((struct end *)handle - ends), command, timeout);
    *state = command;
    return 0;
}

int32_t xChannelBusState(void *handle, uint32_t command, uint32_t *state, uint32_t timeout) {
    struct end *end = handle;
    int32_t answer;
    CALLED("%d, %u, %u", (int)(end - ends), command, timeout);
    pthread_mutex_lock(&lock);
    end->is_on = (int)command;
    end->is_full = other(end)->is_full = 0;
    *state = command;
    answer = command == 1 && !other(end)->is_on ? (int32_t)NO_COM : (int32_t)code;
    pthread_mutex_unlock(&lock);
    return answer;
}

int32_t xChannelWatchdog(void *handle, uint32_t command, uint32_t *trigger) {
    CALLED("%d, %u", (int)((struct end *)handle - ends), command);
    *trigger = command;
    return 0;
}

int32_t xChannelIOWrite(void *handle, uint32_t area, uint32_t offset, uint32_t length, void *data, uint32_t timeout) {
    struct end *end = handle;
    int32_t answer = 0;
    CALLED("%d, %u, %u, %u, %u", (int)(end - ends), area, offset, length, timeout);
    if (offset + length > IMAGE)
        return (int32_t)INVALID_ACCESS_SIZE;
    pthread_mutex_lock(&lock);
    if (code != 0 || !end->is_on || !other(end)->is_on)
        answer = (int32_t)NO_COM;
    else if (end->is_full)
        answer = (int32_t)FAILED;
    else
        end->is_full = 1;
    if (answer != (int32_t)FAILED)
        memcpy(end->image + offset, data, length);
    if (answer == (int32_t)NO_COM) {
        FILE *image = beside("image", "w");
        fwrite(end->image, 1, IMAGE, image);
        fclose(image);
    }
    pthread_mutex_unlock(&lock);
    return answer;
}

int32_t xChannelIORead(void *handle, uint32_t area, uint32_t offset, uint32_t length, void *data, uint32_t timeout) {
    struct end *end = handle;
    int32_t answer = 0;
    CALLED("%d, %u, %u, %u, %u", (int)(end - ends), area, offset, length, timeout);
    if (offset + length > IMAGE)
        return (int32_t)INVALID_ACCESS_SIZE;
    pthread_mutex_lock(&lock);
    if (code != 0 || !end->is_on || !other(end)->is_on)
        answer = (int32_t)NO_COM;
    else if (!other(end)->is_full)
        answer = (int32_t)FAILED;
    else
        other(end)->is_full = 0;
    if (answer != (int32_t)FAILED)
        memcpy(data, other(end)->image + offset, length);
    pthread_mutex_unlock(&lock);
    return answer;
}
