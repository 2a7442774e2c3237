/* Options that went, and what to do instead: the text of the error message. */
#include <string.h>

#include "pipeline/options.h"

/* clang-format off */
static const char *const gone[][2] = { /* "VERB NAME": of that verb alone */
    {"welds",          "nothing is cut: it took limbs, and improved no figure"},
    {"quality",        "--effort best"},
    {"config",         "--method FILE"},
    {"voxel",              "thin the capture before the run; points-max of the method thins what is too dense"},
    {"hidden-layers",  "the decoder has two, as the published code's; --method '{\"width-1\": 128}' is a smaller one"},
    {"normal-grid",    "--method '{\"normal-channels\": 0}'"},
    {"truth",          "neupig eval OUT TRUTH, after the run"},
    {"max-residual",   "--bars residual=PERCENT"},
    {"min-coverage",   "--bars coverage=PERCENT"},
    {"max-flipped",    "--bars flipped=PERCENT"},
    {"max-stretched",  "--bars stretched=PERCENT"},
    {"max-unsupported", "--bars unsupported=PERCENT"},
    {"max-invented",   "--bars invented=PERCENT"},
    {"cover-distance", "--bars cover=PERCENT"},
    {"depth-near",     "--depth-range A:"},
    {"depth-far",      "--depth-range :B"},
    {"follow-idle",    "--follow-end SECONDS"},
    {"format",         "--export obj"},
    {"rig",            "the rig is the input: neupig run rig.json"},
    {"sensor-tolerance", "rig_json.py --tolerance SECONDS, which matches images with times"},
    {"optimization",   "tools/method_json.py makes a method of a configuration of the published code"},
    {"grid",           "tools/method_json.py makes a method of a configuration of the published code"},
    {"mlp",            "tools/method_json.py makes a method of a configuration of the published code"},
    {"descriptor",     "tools/method_json.py makes a method of a configuration of the published code"},
    {"batch dry-run",  "neupig probe CAPTURE says what a capture costs"},
    {"batch view",     "neupig view OUT/NAME, after the batch"},
    {"view port",      "--live writes the page, and writes it anew as frames come"},
    {"apply between",  "frames in between lie on curves through the run's meshes"},
};
/* clang-format on */

const char *npg_option_gone(const char *name)
{
    for (size_t i = 0; i < sizeof gone / sizeof *gone; i++)
        if (!strcmp(gone[i][0], name)) return gone[i][1];
    return NULL;
}
