/* Robust: weights of residuals, and when two normals agree; one name for each in all rooms. */
#ifndef NPG_ROBUST_H
#define NPG_ROBUST_H

/* Standard deviations of normal noise per median deviation. */
#define NPG_DEVIATIONS_PER_MEDIAN 1.4826

/* Cosine of two normals: above it they are of one side of a thin part, below minus that of both. */
#define NPG_SAME_SIDE 0.3f

/* Below this cosine a normal speaks against another. */
#define NPG_AGAINST (-0.2)

/* Geman and McClure's weight of a residual, given squared: 1 at 0, a quarter at `width`. */
static inline double npg_geman_mcclure(double residual_sq, double width)
{
    double share = 1 / (1 + residual_sq / (width * width));
    return share * share;
}

#endif
