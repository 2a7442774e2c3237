/* Kernels: the self-test. */
#include "kernels.h"

npg_status npg_kernels_self_test(npg_device *device)
{
    for (const npg_kernel_case *c = npg_kernel_cases; c->op; c++) {
        double error = 0;
        NPG_TRY(npg_error_prefix(c->check(device, 1, 1, &error), "self-test of %s", c->op));
        if (!(error <= c->tolerance))
            return npg_error(NPG_DEVICE, "%s computes op %s wrong: error %.3g, allowed %.3g",
                             npg_device_facts(device)->name, c->op, error, c->tolerance);
    }
    return NPG_OK;
}

const npg_kernel_case npg_kernel_cases[] = {{0}};
