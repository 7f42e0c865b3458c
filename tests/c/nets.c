/* Nets on the page of the process: drawn once, put when somebody looks, closed; wrong JSON is answered with its place. */
#include <stdio.h>
#include <string.h>

#include "tickbus.h"

#define EXPECT(got, wanted)                                                                                    \
    do {                                                                                                       \
        long got_ = (long)(got), wanted_ = (long)(wanted);                                                     \
        if (got_ != wanted_) {                                                                                 \
            printf("line %d: %s is %ld, not %ld: %s\n", __LINE__, #got, got_, wanted_, tb_last_error());       \
            return 1;                                                                                          \
        }                                                                                                      \
    } while (0)

#define SAID(part) EXPECT(strstr(tb_last_error(), part) != NULL, 1)

static const char *drawing =
    "{\"nets\":[{\"name\":\"press\",\"svg\":\"<svg xmlns=\\\"http://www.w3.org/2000/svg\\\"/>\",\"places\":[\"idle\"],"
    "\"transitions\":[{\"name\":\"start\"}]}]}";
static const char *state =
    "{\"nets\":[{\"scans\":1,\"us\":0,\"tokens\":[1],\"phases\":\"3\",\"fired\":[0],\"last\":[null]}]}";

int main(void) {
    tb_nets nets = 7, others;
    EXPECT(tb_nets_open(NULL, "Press", &nets), TB_BAD_ARGUMENT);
    EXPECT(nets, 0);
    EXPECT(tb_nets_open("127.0.0.1:0", NULL, &nets), TB_BAD_ARGUMENT);
    EXPECT(tb_nets_open("127.0.0.1:0", "Press", NULL), TB_BAD_ARGUMENT);
    EXPECT(tb_nets_open("8080", "Press", &nets), TB_BAD_ARGUMENT);
    SAID("the page's address: the address \"8080\" has no port");
    EXPECT(tb_nets_draw(1, drawing), TB_BAD_ARGUMENT);
    SAID("no nets were opened");

    EXPECT(tb_nets_open("127.0.0.1:0", "Press", &nets), TB_FRESH);
    EXPECT(tb_nets_put(nets, state), TB_BAD_ARGUMENT);
    SAID("not drawn yet");
    EXPECT(tb_nets_draw(nets, "{\"nets\":[{]}"), TB_BAD_ARGUMENT);
    SAID("line 1 column 11");
    EXPECT(tb_nets_draw(nets, NULL), TB_BAD_ARGUMENT);
    EXPECT(tb_nets_draw(nets, drawing), TB_FRESH);
    EXPECT(tb_nets_put(nets, state), TB_FRESH);
    EXPECT(tb_nets_put(nets, "{\"nets\":[]}"), TB_BAD_ARGUMENT);
    SAID("there are 0; expected 1");
    EXPECT(tb_nets_wanted(nets, 0), 0);
    EXPECT(tb_nets_wanted(nets, 1000000), 0);

    /* Further nets of the process are on the same page. */
    EXPECT(tb_nets_open("127.0.0.1:0", "Other", &others), TB_FRESH);
    char page[200], other[200];
    EXPECT(tb_nets_page(nets, page, sizeof page) > 0, 1);
    EXPECT(tb_nets_page(others, other, sizeof other) > 0, 1);
    EXPECT(strcmp(page, other), 0);
    EXPECT(strncmp(page, "http://127.0.0.1:", 17), 0);
    EXPECT(strchr(page, '#') == NULL, 1);
    EXPECT(tb_nets_close(others), TB_FRESH);
    EXPECT(tb_nets_close(nets), TB_FRESH);
    EXPECT(tb_nets_close(nets), TB_BAD_ARGUMENT);
    SAID("these nets are closed");
    EXPECT(tb_nets_wanted(nets, 0), TB_BAD_ARGUMENT);
    return 0;
}
