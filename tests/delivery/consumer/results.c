/* A program outside the project that looks at a capture and at what a run made of it, as the command does.
 * results CAPTURE OUT: CAPTURE has points/ and truth/; OUT is the run's folder. */
#include <neupig.h>
#include <stdio.h>
#include <string.h>

static int frames_told;

static void tell(void *user, const npg_eval_figures *figures)
{
    (void)user;
    frames_told += figures->frames == frames_told && figures->cd > 0;
}

static int probe(const char *capture)
{
    char input[1024];
    npg_options *options = NULL;
    npg_capture_facts *facts = NULL;
    snprintf(input, sizeof input, "%s/points", capture);
    if (npg_options_open(&options) || npg_options_set(options, "input", input)) return 1;
    npg_status status = npg_capture_probe(&facts, options);
    npg_options_close(&options);
    if (status != NPG_OK && status != NPG_PARTIAL) return 1;
    if (facts->frames != 2 || facts->points_total != 1200 || !(facts->box_high[1] > facts->box_low[1]))
        return 1;
    if (!strstr(facts->text, "frames    2") || facts->json[0] != '{') return 1;
    npg_capture_facts_close(&facts);
    return 0;
}

static int eval(const char *capture, const char *out)
{
    npg_eval_figures all = {.struct_size = sizeof all};
    npg_eval_settings asked = {.struct_size = sizeof asked,
                               .predicted = out,
                               .truth = capture,
                               .samples = 2000,
                               .tau = 0.005,
                               .frame = tell};
    if (npg_eval(&all, &asked)) return 2;
    printf("CD %.2f over %d frames\n", all.cd, (int)all.frames);
    return all.frames == 2 && frames_told == 2 && all.cd > 0 && all.constant_topology && all.vertices ? 0 : 2;
}

static int apply(const char *out)
{
    char mesh[1024];
    npg_applied applied = {.struct_size = sizeof applied};
    npg_apply_settings settings = {
        .struct_size = sizeof settings, .job = out, .mesh = mesh, .output = "carried", .far_share = 0.05};
    snprintf(mesh, sizeof mesh, "%s/reference.ply", out);
    return npg_apply(&applied, &settings) || applied.frames != 2 || applied.far_count ? 3 : 0;
}

static int draw(void)
{
    const char *const files[] = {"carried/frame_0000.ply", "carried/frame_0001.ply"};
    npg_picture picture = {.struct_size = sizeof picture};
    npg_picture_settings settings = {.struct_size = sizeof settings, .width = 40, .height = 60};
    if (npg_picture_write(&picture, "two.png", files, 2, &settings)) return 4;
    return picture.width == 80 && picture.height == 60 ? 0 : 4;
}

int main(int argc, char **argv)
{
    if (argc != 3) return 9;
    int wrong = probe(argv[1]);
    if (!wrong) wrong = eval(argv[1], argv[2]);
    if (!wrong) wrong = apply(argv[2]);
    if (!wrong) wrong = draw();
    if (wrong) fprintf(stderr, "%s\n", npg_error_text());
    return wrong;
}
