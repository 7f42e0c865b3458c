/* standin_cif.c: stands in for CIF32DLL, for the tests.
 *
 * Devices 0 and 1 have 2 KiB each, and their process images are joined: what one sends the other one receives. The bus
 * of each communicates while both hosts are ready. As long as the other end has not read an image, its writer's next
 * exchange is EXCHANGE_FAILED.
 */
#include "standin.h"

enum { NUMBER_INVALID = -34, SEND_TOO_LONG = -46, NO_COM = -21, FAILED = -22, IMAGE = 512 };

static struct end {
    int is_ready, is_full;
    uint8_t image[IMAGE];
} ends[2];

#define CALLED(...)                                               \
    long code;                                                    \
    if (called(&code, __func__, __VA_ARGS__) && code != NO_COM)   \
    return (int16_t)code

int16_t DevOpenDriver(uint16_t device) {
    CALLED("%d", device);
    return 0;
}

int16_t DevCloseDriver(uint16_t device) {
    CALLED("%d", device);
    return 0;
}

int16_t DevInitBoard(uint16_t device, void *address) {
    CALLED("%d, %s", device, address == NULL ? "NULL" : "wrong");
    return device > 1 ? NUMBER_INVALID : 0;
}

int16_t DevExitBoard(uint16_t device) {
    CALLED("%d", device);
    return 0;
}

int16_t DevGetInfo(uint16_t device, uint16_t area, uint16_t size, void *data) {
    CALLED("%d, %d, %d", device, area, size);
    if (area == 6)
        memcpy(data, "\2\1\1DPS", 6);
    else
        memcpy(data, "DPS             V01.150 01.01.01", 32);
    return 0;
}

int16_t DevReset(uint16_t device, uint16_t mode, uint32_t timeout) {
    CALLED("%d, %d, %u", device, mode, timeout);
    return (int16_t)code;
}

int16_t DevSetHostState(uint16_t device, uint16_t mode, uint32_t timeout) {
    CALLED("%d, %d, %u", device, mode, timeout);
    pthread_mutex_lock(&lock);
    ends[device].is_ready = mode;
    ends[0].is_full = ends[1].is_full = 0;
    pthread_mutex_unlock(&lock);
    return (int16_t)code;
}

int16_t DevExchangeIO(uint16_t device, uint16_t send_offset, uint16_t send_size, void *send, uint16_t receive_offset,
                      uint16_t receive_size, void *receive, uint32_t timeout) {
    struct end *end = &ends[device], *other = &ends[1 - device];
    int16_t answer = 0;
    CALLED("%d, %d, %d, %d, %d, %u", device, send_offset, send_size, receive_offset, receive_size, timeout);
    if (send_offset + send_size > IMAGE || receive_offset + receive_size > IMAGE)
        return SEND_TOO_LONG;
    pthread_mutex_lock(&lock);
    if (code != 0 || !end->is_ready || !other->is_ready)
        answer = NO_COM;
    else if (end->is_full)
        answer = FAILED;
    else
        end->is_full = 1;
    if (answer != FAILED) {
        memcpy(end->image + send_offset, send, send_size);
        memcpy(receive, other->image + receive_offset, receive_size);
        other->is_full = 0;
    }
    if (answer == NO_COM) {
        FILE *image = beside("image", "w");
        fwrite(end->image, 1, IMAGE, image);
        fclose(image);
    }
    pthread_mutex_unlock(&lock);
    return answer;
}

int16_t DevTriggerWatchDog(uint16_t device, uint16_t function, uint16_t *trigger) {
    CALLED("%d, %d", device, function);
    *trigger = function;
    return 0;
}
