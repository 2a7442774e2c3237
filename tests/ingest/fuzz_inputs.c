/* Fuzz target of the input log of a live run, for libFuzzer: lines that are no such lines are refused,
 * indices count from 0 on, names have an end. */
#include <string.h>

#include "ingest/input_log.h"
#include "tests/support/fuzz_target.h"

static void check_entries(npg_input_log *log)
{
    size_t count;
    int64_t next = 0;
    const npg_input_entry *entries = npg_input_log_entries(log, &count);
    for (size_t i = 0; i < count; i++) {
        expect(entries[i].index == -1 || entries[i].index == next, "an index out of order");
        next += entries[i].index == next;
        expect(entries[i].bytes >= -1 && entries[i].digits >= 0, "a number out of range");
        if (entries[i].name) expect(strlen(entries[i].name) < 4096, "a name without end");
        for (int holds = 0; holds < 2; holds++) npg_input_log_needs(log, i, holds);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int fd;
    npg_input_log *log = NULL;
    const char *path = fuzz_file(&fd, "inputs.jsonl", data, size);
    /* "{}" alone makes an entry and the end of its line: more than fuzz_bound() has */
    npg_memory_set_limit(npg_memory_used() + 128 * size + ((size_t)1 << 20));
    npg_status status = npg_input_log_read(&log, path, (int64_t)size);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "input log");
    if (!status) check_entries(log);
    npg_input_log_close(&log);
    fuzz_end();
    return 0;
}
