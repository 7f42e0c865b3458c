/* The line takes the settings of a file that has changed, or says why not. */
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

static const char *name;

/* Writes a file whose machine is on this link, and whose signal has this type. */
static void write_file(const char *link, const char *type) {
    FILE *file = fopen(name, "w");
    fprintf(file,
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"%s\"\n"
        "[[signal]]\nname = \"Level\"\naddress = \"%%IW0\"\ntype = \"%s\"\n",
        link, type);
    fclose(file);
}

int main(int count, char **arguments) {
    if (count < 2) return 2;
    name = arguments[1];
    write_file("first", "INT");
    tb_driver plc;
    EXPECT(tb_open(name, NULL, &plc), TB_FRESH);
    EXPECT(tb_reload(plc), TB_UNCHANGED);
    write_file("second", "INT");
    EXPECT(tb_reload(plc), TB_FRESH);
    EXPECT(tb_reload(plc), TB_UNCHANGED);
    EXPECT(tb_exchange(plc) < 0, 0);

    /* Nothing of a file is taken that has mistakes, or in which more than the line differs. */
    write_file("third", "INTEGER");
    EXPECT(tb_reload(plc), TB_BAD_CONFIG);
    EXPECT(strstr(tb_last_error(), ":10:8: ") != NULL, 1);
    write_file("third", "UINT");
    EXPECT(tb_reload(plc), TB_UNSUPPORTED);
    EXPECT(strstr(tb_last_error(), "signal 1 \"Level\" has another type") != NULL, 1);
    write_file("second", "INT");
    EXPECT(tb_reload(plc), TB_UNCHANGED);

    /* Tables in place of the file's own stay in place. */
    tb_driver own;
    EXPECT(tb_open(name, "[fieldbus]\nkind = \"loopback\"\nlink = \"own\"\n", &own), TB_FRESH);
    write_file("fourth", "INT");
    EXPECT(tb_reload(own), TB_UNCHANGED);
    EXPECT(tb_reload(plc), TB_FRESH);
    EXPECT(tb_close(own), TB_FRESH);
    EXPECT(tb_close(plc), TB_FRESH);
    EXPECT(tb_reload(plc), TB_CLOSED);
    EXPECT(tb_reload(0), TB_NOT_OPEN);
    return 0;
}
