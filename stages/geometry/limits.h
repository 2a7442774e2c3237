/* Limits: notions that several rooms share, each one number.
 *
 * What is said of a surface, its points and its frames is said in their own measures (spacings, deviations,
 * medians, sizes); how many of these is enough was set by trial, once: tests/bed/decisions.md, "Limits". */
#ifndef NPG_GEOMETRY_LIMITS_H
#define NPG_GEOMETRY_LIMITS_H

/* Spacings of the points, deviations of their noise, usual or median distances: what lies within so many belongs
 * to the surface, what lies farther off does not. */
#define NPG_WITHIN 2.5

/* Deviations, spacings, usual distances or motions: what is beyond so many is no chance. */
#define NPG_BEYOND 3.0

/* Times another: clearly more than it. */
#define NPG_CLEARLY 2.0

/* Spacings: surface that was sampled has a point within so many. */
#define NPG_SAMPLED 2.0

/* Spacings: sheets of points closer than that share the cells of an octree. */
#define NPG_GAP 1.2

/* Share of an area, or of a set, that is let pass without a word. */
#define NPG_FEW 0.02

/* More than half of those that say anything. */
#define NPG_MAJORITY 0.5

/* Most of a set: the rest may be wrongly followed, paired or turned. */
#define NPG_MOST 0.8

/* Of its measure: a solution that changes by less has settled. */
#define NPG_SETTLED 0.01

/* Of a diagonal: detail smaller than that is not told from noise; parts of one body without points between lie
 * no farther apart; and what is farther from every point is none of the body's. */
#define NPG_DETAIL_SHARE 0.015
#define NPG_NEARBY_SHARE 0.1
#define NPG_REMOTE_SHARE 0.15

/* Diagonals of a cloud, from its middle: where a sensor is taken to stand, if nobody knows. */
#define NPG_SENSOR_AWAY 1.5

/* Points around one that say how dense and noisy a cloud is there, and those that are a piece of surface. */
#define NPG_AROUND 8
#define NPG_PATCH  16

/* Frames that say the same: one alone may be wrong. */
#define NPG_CONFIRMED 2

/* Of loops that end by themselves. */
#define NPG_ROUNDS_MOST 12

#endif
