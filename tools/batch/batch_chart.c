/* Chart in a page: the error of every frame as inline SVG. */
#include <math.h>

#include "tools/batch/batch_page.h"

enum {
    WIDTH = 640,
    HEIGHT = 150,
    LEFT = 44,
    TOP = 10,
    BOTTOM = 22,
    RIGHT = 8,
    POINTS_MAX = 600, /* of the line: about one a pixel */
    MARKS_MAX = 200   /* circles and cuts               */
};

typedef struct chart {
    const npg_capture_figures *figures;
    double top; /* the error at the upper edge */
} chart;

static double x_of(const chart *c, size_t i)
{
    size_t last = c->figures->count > 1 ? c->figures->count - 1 : 1;
    return LEFT + (double)(WIDTH - LEFT - RIGHT) * (double)i / (double)last;
}

static double y_of(const chart *c, double error)
{
    return TOP + (HEIGHT - TOP - BOTTOM) * (1 - fmin(error / c->top, 1));
}

static double upper_edge(const npg_capture_figures *f)
{
    double most = f->worst < f->count ? f->frames[f->worst].error : 0;
    /* The bar is shown, unless it would press the line flat. */
    if (isfinite(f->bar) && f->bar < 20 * most) most = fmax(most, f->bar);
    return most > 0 ? 1.1 * most : 1;
}

/* The largest error of the frames first .. end - 1, NaN when none has one. */
static double largest(const npg_capture_figures *f, size_t first, size_t end)
{
    double most = (double)NAN;
    for (size_t i = first; i < end; i++)
        if (isfinite(f->frames[i].error) && !(f->frames[i].error <= most)) most = f->frames[i].error;
    return most;
}

/* Lines break where frames have no error.  Of long captures each point is the worst of its neighbours. */
static void draw_line(npg_file *page, const chart *c)
{
    const npg_capture_figures *f = c->figures;
    size_t step = (f->count + POINTS_MAX - 1) / POINTS_MAX;
    bool open = false;
    for (size_t i = 0; i < f->count; i += step) {
        double error = largest(f, i, i + step < f->count ? i + step : f->count);
        bool has = isfinite(error);
        if (has)
            npg_file_print(page, "%s%.1f,%.1f", open ? " " : "<polyline class=\"line\" points=\"", x_of(c, i),
                           y_of(c, error));
        if (!has && open) npg_file_print(page, "\"/>\n");
        open = has;
    }
    if (open) npg_file_print(page, "\"/>\n");
}

static void draw_bar(npg_file *page, const chart *c)
{
    double bar = c->figures->bar;
    if (!isfinite(bar) || bar > c->top) return;
    npg_file_print(page,
                   "<line class=\"bar\" x1=\"%d\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\">"
                   "<title>bar: %.3g %%</title></line>\n",
                   LEFT, WIDTH - RIGHT, y_of(c, bar), y_of(c, bar), bar);
}

/* Where a segment takes over from the one before. */
static void draw_cuts(npg_file *page, const chart *c)
{
    const npg_capture_figures *f = c->figures;
    for (size_t i = 1, next = 1; i < json_array_size(f->segments) && i <= MARKS_MAX; i++) {
        const json_t *segment = json_array_get(f->segments, i);
        long long first = (long long)json_integer_value(json_object_get(segment, "first_frame"));
        while (next < f->count && f->frames[next].number < first) next++;
        double x = x_of(c, next) - (x_of(c, 1) - x_of(c, 0)) / 2;
        npg_file_print(page,
                       "<line class=\"cut\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%d\" y2=\"%d\">"
                       "<title>another reference from frame %lld</title></line>\n",
                       x, x, TOP, HEIGHT - BOTTOM, first);
    }
}

static void draw_marks(npg_file *page, const chart *c)
{
    const npg_capture_figures *f = c->figures;
    size_t drawn = 0;
    for (size_t i = 0; i < f->count && drawn < MARKS_MAX; i++) {
        const npg_frame_figures *frame = &f->frames[i];
        bool has = isfinite(frame->error);
        if (frame->good && i != f->worst) continue;
        drawn++;
        npg_file_print(page, "<circle class=\"%s\" cx=\"%.1f\" cy=\"%.1f\" r=\"3\"><title>frame %lld: ",
                       frame->skipped ? "skipped"
                       : frame->good  ? "worst"
                                      : "bad",
                       x_of(c, i), has ? y_of(c, frame->error) : (double)(HEIGHT - BOTTOM),
                       (long long)frame->number);
        if (has)
            npg_file_print(page, "%.4g %%%s</title></circle>\n", frame->error,
                           frame->good ? "" : ", below the bar");
        else
            npg_file_print(page, "%s</title></circle>\n", frame->skipped ? "skipped" : "not measured");
    }
}

static void draw_axes(npg_file *page, const chart *c)
{
    const npg_capture_figures *f = c->figures;
    int low = HEIGHT - BOTTOM;
    npg_file_print(page, "<path class=\"axis\" d=\"M%d %d V%d H%d\"/>\n", LEFT, TOP, low, WIDTH - RIGHT);
    npg_file_print(page, "<text x=\"%d\" y=\"%d\" text-anchor=\"end\">%.2g %%</text>\n", LEFT - 4, TOP + 8,
                   c->top);
    npg_file_print(page, "<text x=\"%d\" y=\"%d\" text-anchor=\"end\">0</text>\n", LEFT - 4, low);
    npg_file_print(page, "<text x=\"%d\" y=\"%d\">frame %lld</text>\n", LEFT, HEIGHT - 6,
                   (long long)f->frames[0].number);
    npg_file_print(page, "<text x=\"%d\" y=\"%d\" text-anchor=\"end\">%lld</text>\n", WIDTH - RIGHT,
                   HEIGHT - 6, (long long)f->frames[f->count - 1].number);
}

void npg_page_chart(npg_file *page, const npg_capture_figures *figures)
{
    const chart c = {figures, upper_edge(figures)};
    if (!figures->count) return;
    npg_file_print(page,
                   "<svg xmlns=\"http://www.w3.org/2000/svg\" "
                   "viewBox=\"0 0 %d %d\" width=\"%d\" height=\"%d\" role=\"img\">"
                   "<title>error of every frame</title>\n",
                   WIDTH, HEIGHT, WIDTH, HEIGHT);
    draw_axes(page, &c);
    draw_bar(page, &c);
    draw_cuts(page, &c);
    draw_line(page, &c);
    draw_marks(page, &c);
    npg_file_print(page, "</svg>\n");
}
