/*
 * Two motions of one model at once, without dry friction. What is a number in motion.c is a pair here, a number of each
 * motion, and the numbers are the same to the last bit.
 */

#ifndef STUDY_TWO_MOTIONS_H
#define STUDY_TWO_MOTIONS_H

#include "motion.h"

typedef struct {
    int64_t of;       /* state by which a row is differentiated */
    const Pair *from; /* registers of the partial derivative */
} PairPartial;

typedef struct {
    const Motion *one;                   /* a motion made ready, whose program and rows are these too */
    Program program;                     /* of pairs */
    Pair *r;                             /* its registers */
    const Pair **direct;                 /* value, derivatives by keys, zeros: registers of each row, one a column */
    PairPartial *by_state;               /* of which those of a row end as in the other motion */
    Pair *state, *trial, *other, *sum;   /* states x columns each */
} TwoMotions;

/* Room, and a program, for two of a motion made ready; 0 where there is no memory. */
int prepare_two(TwoMotions *two, const Motion *one, int64_t registers);
void forget_two(TwoMotions *two);

/*
 * Both from their `states`, states x columns, from their `starts` on along so many samples; `drive` and `out` are those
 * of each, as for `integrate`. What the second shows at its first sample, which the first may overwrite, is kept in
 * `begun`. Returns 0 if one of them is not finite; else the states become those of the last sample.
 */
int along_both(
    TwoMotions *two, double *const states[2], const double starts[2], double dt, int64_t steps,
    const double *const drive[2], const int64_t *observed, int64_t count, int64_t samples, double *const out[2],
    double *begun
);

#endif
