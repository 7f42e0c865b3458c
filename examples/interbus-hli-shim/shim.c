/* shim.c: an INTERBUS controller board for tickbus, by the vendor's high-level language interface (HLI).
 *
 * The HLI's header is not public, so tickbus cannot call the HLI directly: compile this file with your copy of the header
 * to get a plug-in. The shim has never run with the vendor's library or a board; the tests compile and run it with an
 * invented header.
 *
 * CMD, the vendor's configurator, exports your bus as C: the process data objects as global variables, and three
 * functions, which start the bus, end it, and run one cycle. According to the publication about a cell that was
 * controlled in this way (Piedrafita and Garcia, Universidad de Zaragoza, sections 2.1 and 3.2), they call:
 *
 *     start    IBS_HLI_Init_CFG with the list of devices, in the mode IBS_STANDARD
 *              IBS_HLI_RegisterPDOObject for each object, with the address of its variable
 *              IBS_HLI_ResetAllOutputs
 *              IBS_HLI_StartBus
 *     a cycle  IBS_HLI_PD_In, then IBS_HLI_PD_Out, each only while BusState is HLI_IBS_RUN
 *     end      IBS_HLI_ResetAllOutputs
 *              IBS_HLI_Exit
 *
 * Write your own header that includes the files exported by CMD, and that defines, with the names of your export:
 *
 *     HLI_INIT()         starts the bus; its value is HLI_OKAY on success
 *     HLI_CYCLE()        runs a cycle, likewise
 *     HLI_EXIT()         ends it, outputs reset
 *     HLI_RUNS()         true while the bus runs, such as (PCI1.BusState == HLI_IBS_RUN)
 *     HLI_OUTPUT_BITS(X) what tickbus sends: X(byte, bit, variable) for each object of one bit, X(0, 3, Valve)
 *     HLI_OUTPUT_WORDS(X)                    X(byte, variable) for each object of 16 bits
 *     HLI_INPUT_BITS(X), HLI_INPUT_WORDS(X)  what tickbus receives, likewise
 *
 * byte and bit are those of the signal's address in driver.cfg. Define a list without objects as empty.
 *
 * Build: cc -std=c99 -O2 -Wall -Wextra -fPIC -shared -I ../../include -DHLI_CELL='"cell.h"' -o libhlishim.so shim.c
 *        cl /O2 /LD /I ..\..\include /DHLI_CELL="\"cell.h\"" shim.c and the vendor's import library
 */
#ifndef HLI_CELL
#error "no header of the vendor's: write cell.h as the head of shim.c says, and compile with -DHLI_CELL='\"cell.h\"'"
#else

#include HLI_CELL

#if !defined HLI_INIT || !defined HLI_CYCLE || !defined HLI_EXIT || !defined HLI_RUNS || !defined HLI_OKAY
#error "cell.h has to define HLI_INIT, HLI_CYCLE, HLI_EXIT and HLI_RUNS, and include the header that has HLI_OKAY"
#endif
#if !defined HLI_OUTPUT_BITS || !defined HLI_OUTPUT_WORDS || !defined HLI_INPUT_BITS || !defined HLI_INPUT_WORDS
#error "cell.h has to define HLI_OUTPUT_BITS, HLI_OUTPUT_WORDS, HLI_INPUT_BITS and HLI_INPUT_WORDS"
#endif

#include "tickbus_fieldbus.h"

#include <stdio.h>
#include <string.h>

struct tickbus_bus {
    uint32_t in_size, out_size;
};

/* The objects are global variables: there is one bus of this kind in a process. */
static struct tickbus_bus the_bus;
static int is_open;
static char error[300];

static int32_t fail(int32_t code, const char *what, long number, const char *right) {
    snprintf(error, sizeof error, "%s %ld; %s", what, number, right);
    return code;
}

uint32_t tickbus_abi_version(void) {
    return TICKBUS_ABI_VERSION;
}

int32_t tickbus_open(const tickbus_config *config, const tickbus_layout *layout, tickbus_bus **bus) {
    uint32_t sent = 0, received = 0; /* how far the objects reach */
    int code;

    if (config->option_count != 0)
        return fail(TICKBUS_E_CONFIG, "the number of options is", (long)config->option_count,
                    "remove `options`: cell.h says all");
    if (is_open)
        return fail(TICKBUS_E_UNSUPPORTED, "drivers in this process that have the board:", 1,
                    "use isolated = true for one of them, and another build of shim.c");
#define REACH_BIT(byte, bit, variable) reach = (byte) + 1u > reach ? (byte) + 1u : reach;
#define REACH_WORD(byte, variable) reach = (byte) + 2u > reach ? (byte) + 2u : reach;
    {
        uint32_t reach = 0;
        HLI_OUTPUT_BITS(REACH_BIT)
        HLI_OUTPUT_WORDS(REACH_WORD)
        sent = reach;
    }
    {
        uint32_t reach = 0;
        HLI_INPUT_BITS(REACH_BIT)
        HLI_INPUT_WORDS(REACH_WORD)
        received = reach;
    }
    if (sent > layout->in_size)
        return fail(TICKBUS_E_UNSUPPORTED, "cell.h needs bytes to send, up to byte", (long)sent,
                    "add the signals to driver.cfg, or set its sizes");
    if (received > layout->out_size)
        return fail(TICKBUS_E_UNSUPPORTED, "cell.h has bytes to receive, up to byte", (long)received,
                    "add the signals to driver.cfg, or set its sizes");
    code = (int)HLI_INIT();
    if (code != HLI_OKAY)
        return fail(TICKBUS_E_LINK, "the bus did not start: its function returned", code,
                    "see the vendor's manual, and the board's diagnosis");
    the_bus.in_size = layout->in_size;
    the_bus.out_size = layout->out_size;
    is_open = 1;
    *bus = &the_bus;
    return TICKBUS_OK;
}

int32_t tickbus_exchange(tickbus_bus *bus, const uint8_t *in, uint8_t *out, uint32_t timeout_ms) {
    int code;
    (void)timeout_ms;
    (void)in;

#define SEND_BIT(byte, bit, variable) (variable) = in[byte] >> (bit) & 1;
#define SEND_WORD(byte, variable) (variable) = (unsigned short)(in[byte] << 8 | in[(byte) + 1]);
    HLI_OUTPUT_BITS(SEND_BIT)
    HLI_OUTPUT_WORDS(SEND_WORD)
    code = (int)HLI_CYCLE();
    if (code != HLI_OKAY)
        return fail(TICKBUS_E_LINK, "the cycle failed: its function returned", code,
                    "see the vendor's manual, and the board's diagnosis");
    if (!HLI_RUNS())
        return 0;
    memset(out, 0, bus->out_size);
#define RECEIVE_BIT(byte, bit, variable) out[byte] |= (uint8_t)(((variable) != 0) << (bit));
#define RECEIVE_WORD(byte, variable)               \
    out[byte] = (uint8_t)((variable) >> 8 & 0xFF); \
    out[(byte) + 1] = (uint8_t)((variable)&0xFF);
    HLI_INPUT_BITS(RECEIVE_BIT)
    HLI_INPUT_WORDS(RECEIVE_WORD)
    return TICKBUS_TAKEN | TICKBUS_FRESH;
}

const char *tickbus_last_error(tickbus_bus *bus) {
    (void)bus;
    return error;
}

void tickbus_close(tickbus_bus *bus) {
    (void)bus;
    HLI_EXIT();
    is_open = 0;
}

#endif
