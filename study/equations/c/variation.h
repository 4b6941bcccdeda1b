/* One coordinate running free with the exact derivatives of its motion. */

#ifndef STUDY_VARIATION_H
#define STUDY_VARIATION_H

#include "program.h"

typedef struct {
    int64_t state;      /* by which a slope is differentiated */
    const double *from; /* register of the partial derivative */
} Partial;

/*
 * The program of slopes and partial derivatives, and room for a state beside its sensitivities: rows of `columns`
 * numbers, the state in the first, filled up to a `width` that is even: two numbers at once are then of one row. A step
 * begins in `state`; `trial` is what the slopes are asked for, `slope` these.
 */
typedef struct {
    Program program;
    int64_t states, columns, width, channels;
    int64_t side;                        /* register that stands for sgn v, -1 if no force jumps with it */
    const double **direct;               /* slope, derivatives by keys, zeros: `width` registers for each slope */
    Partial *by_state;                   /* what is not always zero of the derivatives by states */
    int64_t *state_ends;                 /* where those of each slope end in this list */
    double *state, *trial, *slope, *sum; /* states x width each */
    double *begun;                       /* where a step that is cut began */
    double *local;                       /* three rows of the drive, of a part of a step */
    double *total;                       /* one row of the slopes */
} Variation;

void variation_slopes(Variation *variation, double time, const double *drive);
void variation_step(Variation *variation, double time, double h, const double *drive);

/* Acceleration at a state if sgn v is `sign`, which the register of the side then holds. */
double pull(Variation *variation, double sign, double time, const double *drive, const double *state);

/* One step of a model with sgn v in it, cut where v changes sign, stops, or sets off again. */
void switching_step(Variation *variation, double time, double h, const double *drive);

/* First zero in (0, 1) of the parabola with these ends and mean, v0 >= 0; 2 if it has none. */
double first_zero(double v0, double v1, double mean);

/* The drive at two fractions of a step and between, from the parabola through the step's three rows. */
void drive_between(const double *drive, int64_t channels, double begin, double end, double *local);

static inline double within_one(double x) {
    x = 0.0 > x ? 0.0 : x;
    return 1.0 < x ? 1.0 : x;
}

#endif
