/* standin_ddi.c: stands in for the library of INTERBUS's device driver interface, for the tests.
 *
 * The boards IBB1N1 and IBB2N1 are joined: what one writes the other one reads, image by image. Their bus runs while
 * both were started. The script's lines "mode N" and "answer N" set the plug-and-play mode, and how many octets the
 * answer has that tells it. -DWINDOWS adds Windows' base to each code of the script.
 */
#include "standin.h"

enum { BAD_NAME = 0x91, EXCEEDED = 0x96, NO_MESSAGE = 0x9B, IMAGE = 512, QUEUE = 64 };

#ifdef WINDOWS
enum { BASE = 0xE0070000 };
#else
enum { BASE = 0 };
#endif

#pragma pack(2)
struct access {
    uint16_t length, address, consistency;
    uint8_t *data;
};
struct message {
    uint16_t type, length, user;
    uint8_t *block;
};
#pragma pack()

static struct end {
    int is_started, is_asked;
    unsigned written, read;
    uint8_t images[QUEUE][IMAGE];
} ends[2];

#define CALLED(...)                        \
    long code;                             \
    if (called(&code, __func__, __VA_ARGS__)) \
    return (int)(code == 0 ? 0 : (uint32_t)code + BASE)

/* Handles: 10 and 20 are the data nodes, 11 and 21 the mailboxes. */
static struct end *end_of(int handle) {
    return &ends[handle / 10 - 1];
}

int DDI_DevOpenNode(char *name, int16_t perm, int *handle) {
    int board, end = 0;
    char kind;
    CALLED("%s, %d", name, perm);
    if (sscanf(name, "IBB%dN1_%c%n", &board, &kind, &end) != 2 || name[end] != 0 || board < 1 || board > 2)
        return (int)(BAD_NAME + BASE);
    *handle = board * 10 + (kind == 'M');
    return 0;
}

int DDI_DevCloseNode(int handle) {
    struct end *end = end_of(handle), *other = &ends[end == &ends[0]];
    int turns = 0;
    CALLED("%d", handle);
    pthread_mutex_lock(&lock);
    /* The bus has a cycle after the last write: what was written reaches an end that reads. */
    while (end->is_started && other->is_started && end->read < end->written && turns++ < 200) {
        pthread_mutex_unlock(&lock);
        nanosleep(&(struct timespec){0, 1000000}, NULL);
        pthread_mutex_lock(&lock);
    }
    end->is_started = 0;
    pthread_mutex_unlock(&lock);
    return 0;
}

int DDI_MXI_SndMessage(int handle, struct message *message) {
    char words[100] = "";
    int at;
    for (at = 0; at < message->length; at++)
        sprintf(words + strlen(words), at % 2 || at == 0 ? "%02X" : " %02X", message->block[at]);
    CALLED("%d, %d, %d, %s", handle, message->type, message->user, words);
    pthread_mutex_lock(&lock);
    if (message->block[0] == 0x03)
        end_of(handle)->is_asked = 2;
    if (message->block[0] == 0x07 && message->block[1] == 0x01) {
        end_of(handle)->is_started = 1;
        ends[0].written = ends[0].read = ends[1].written = ends[1].read = 0;
    }
    pthread_mutex_unlock(&lock);
    return 0;
}

int DDI_MXI_RcvMessage(int handle, struct message *message) {
    struct end *end = end_of(handle);
    long mode = 0, length = 12;
    CALLED("%d, %d", handle, message->length);
    /* The answer takes a while. */
    if (end->is_asked == 0 || end->is_asked-- == 2)
        return (int)(NO_MESSAGE + BASE);
    scripted("mode", &mode);
    scripted("answer", &length);
    memset(message->block, 0, message->length);
    memcpy(message->block, "\x83\x51\0\4\0\0\0\1\x22\x40", 10);
    message->block[10] = (uint8_t)(mode >> 8);
    message->block[11] = (uint8_t)mode;
    message->length = (uint16_t)length;
    return 0;
}

int GetIBSDiagnostic(int handle, uint16_t *words) {
    CALLED("%d", handle);
    words[0] = ends[0].is_started && ends[1].is_started ? 0xE0 : 0x80;
    words[1] = 7;
    words[2] = 0; /* the word of later firmware */
    return 0;
}

int DDI_DTI_WriteData(int handle, struct access *access) {
    struct end *end = end_of(handle);
    CALLED("%d, %d, %d, %d", handle, access->address, access->length, access->consistency);
    if (access->address + access->length > IMAGE)
        return (int)(EXCEEDED + BASE);
    pthread_mutex_lock(&lock);
    /* A reader that is far behind gets the newest image in place of the one before. */
    if (end->written - end->read < QUEUE)
        end->written++;
    memcpy(end->images[(end->written - 1) % QUEUE] + access->address, access->data, access->length);
    pthread_mutex_unlock(&lock);
    return 0;
}

int DDI_DTI_ReadData(int handle, struct access *access) {
    struct end *end = end_of(handle), *other = &ends[end == &ends[0]];
    CALLED("%d, %d, %d, %d", handle, access->address, access->length, access->consistency);
    if (access->address + access->length > IMAGE)
        return (int)(EXCEEDED + BASE);
    pthread_mutex_lock(&lock);
    /* Data count from the first read on, so there are some. */
    while (other->is_started && other->written == 0) {
        pthread_mutex_unlock(&lock);
        nanosleep(&(struct timespec){0, 100000}, NULL);
        pthread_mutex_lock(&lock);
    }
    if (other->read < other->written)
        other->read++;
    if (other->read > 0)
        memcpy(access->data, other->images[(other->read - 1) % QUEUE] + access->address, access->length);
    pthread_mutex_unlock(&lock);
    return 0;
}

int EnableWatchDog(int handle) {
    CALLED("%d", handle);
    return 0;
}

int TriggerWatchDog(int handle) {
    CALLED("%d", handle);
    return 0;
}

int ClearWatchDog(int handle) {
    CALLED("%d", handle);
    return 0;
}
