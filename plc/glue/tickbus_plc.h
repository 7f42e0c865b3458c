/* What a shared object with a PLC program shows to tickbus: one table, under one name.
 *
 * tickbus_plc.c fills it for a program that the IEC 61131-3 compiler iec2c has made; programs
 * in other languages can fill it by hand. All times are nanoseconds unless the name says otherwise.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#ifndef TICKBUS_PLC_H
#define TICKBUS_PLC_H

#include <stdint.h>

/* Changes whenever an older reader would misread this file. */
#define TICKBUS_PLC_VERSION 1u

#if defined(_WIN32)
#define TICKBUS_PLC_EXPORT __declspec(dllexport)
#else
#define TICKBUS_PLC_EXPORT __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* One located variable, such as `lamp AT %QX1.0 : BOOL`. */
struct tickbus_located {
    const char *type;      /* its IEC type: "BOOL", "INT", ... */
    const char *area;      /* "I", "Q" or "M"; markers are left to the program */
    const char *size;      /* "X", "B", "W", "D" or "L" */
    const uint32_t *index; /* the numbers of its address: 1, 0 */
    void *value;           /* where it lies, in the machine's own byte order; the program looks at it and
                              changes it in init and scan alone */
    uint32_t indices;      /* how many numbers */
    uint32_t bytes;        /* sizeof its value; a BOOL has one byte, 0 for FALSE */
};

/* The program. All functions are called from one thread at a time, init first and once. */
struct tickbus_plc {
    uint32_t version;       /* TICKBUS_PLC_VERSION */
    uint32_t bytes;         /* sizeof(struct tickbus_plc) */
    uint32_t located_bytes; /* sizeof(struct tickbus_located) */
    uint32_t located_count;
    const struct tickbus_located *located;
    void (*init)(void);
    uint64_t (*tick_time)(void);     /* the scan interval that the program was made for; 0: any */
    uint64_t (*greatest_tick)(void); /* scans count from 0 up to one less than this; 0: without end */
    void (*scan)(int64_t seconds, int64_t nanoseconds, uint64_t tick); /* once, at that time */
};

extern TICKBUS_PLC_EXPORT const struct tickbus_plc tickbus_plc;

#ifdef __cplusplus
}
#endif

#endif
