/* Kernels: the self-test. */
#include "kernels/kernels.h"

#include "kernels/check.h"

npg_status npg_kernels_self_test(npg_device *device)
{
    for (const npg_kernel_case *c = npg_kernel_cases; c->op; c++) {
        double error = 0;
        NPG_TRY(npg_error_prefix(npg_kernel_case_run(c, device, 1, 1, &error), "self-test of %s", c->op));
        if (!(error <= c->tolerance))
            return npg_error(NPG_DEVICE, "%s computes op %s wrong: error %.3g, allowed %.3g",
                             npg_device_facts(device)->name, c->op, error, c->tolerance);
    }
    return NPG_OK;
}

const npg_kernel_case npg_kernel_cases[] = {{"latent", npg_check_latent, 2e-5},
                                            {"sobolev", npg_check_sobolev, 1e-5},
                                            {"mlp", npg_check_mlp, 2e-5},
                                            {"adam", npg_check_adam, 1e-5},
                                            {"transform", npg_check_transform, 2e-5},
                                            {"nearest", npg_check_nearest, 1e-6},
                                            {"chamfer", npg_check_chamfer, 2e-5},
                                            {"isometry", npg_check_isometry, 2e-5},
                                            {0}};
