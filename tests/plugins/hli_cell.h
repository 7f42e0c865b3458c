/* hli_cell.h: stands in for a user's cell.h, for the tests: it returns the sent data as received. */
#define HLI_OKAY 0

#ifndef INIT
#define INIT HLI_OKAY
#endif
#ifndef CYCLE
#define CYCLE HLI_OKAY
#endif
#ifndef RUNS
#define RUNS 1
#endif

static unsigned short sent_bit, sent_word, received_bit, received_word;

static int cell_cycle(void) {
    received_bit = sent_bit;
    received_word = sent_word;
    return CYCLE;
}

#define HLI_INIT() INIT
#define HLI_CYCLE() cell_cycle()
#define HLI_EXIT() (void)(sent_bit = sent_word = 0)
#define HLI_RUNS() RUNS
#define HLI_OUTPUT_BITS(X) X(0, 0, sent_bit)
#define HLI_OUTPUT_WORDS(X) X(2, sent_word)
#define HLI_INPUT_BITS(X) X(0, 0, received_bit)
#define HLI_INPUT_WORDS(X) X(WORD, received_word)

#ifndef WORD
#define WORD 2
#endif
