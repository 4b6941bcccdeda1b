/*
 * A structure running free with the exact derivatives of its motions. The states are displacements, velocities, and the
 * terms' own z; the registers of the program: the displacements and velocities, t, forces and channels, the states z,
 * coefficients and shape parameters.
 *
 * Dry friction makes a force that is linear in the sign s of a relative velocity e.v. While a place moves, s is 1 or -1
 * and a step is cut where e.v vanishes; while it is held, s is whatever keeps e.a at zero, and it lets go where that
 * leaves [-1, 1]. What is held follows from all that is held together: (e da/ds) s = -e.a at s = 0.
 */

#ifndef STUDY_STRUCTURE_H
#define STUDY_STRUCTURE_H

#include "program.h"

typedef struct {
    Program program;
    int64_t coordinates, states, columns, channels, places; /* `places`: those with dry friction */
    const int64_t *slopes;                                  /* registers of the slopes of velocities and own states */
    int64_t slope_count;
    const int64_t *by_state, *by_key; /* rows of three: slope, state or key, register of the partial derivative */
    int64_t by_state_count, by_key_count;
    const int64_t *sides, *by_side;   /* registers of the signs, and of the accelerations' derivatives by each */
    const double *directions;         /* the e of each place */
    double *state, *trial, *slope, *sum, *begun; /* states x columns each; `begun`: where a step that is cut began */
    double *local;                               /* three rows of the drive, of a part of a step */
    double *matrix, *right, *before, *early;     /* room */
    int64_t *held, *fresh;
} Structure;

/* Derivatives of `trial` into `slope`: of the states, and of so many columns less one of their sensitivities. */
void structure_slopes(Structure *structure, double time, const double *drive, int64_t columns);
void structure_step(Structure *structure, double time, double h, const double *drive, int64_t columns);

/* The held places of a structure; the program has run at this state with any signs. */
void hold(Structure *structure);
void hold_derivatives(Structure *structure, int64_t columns);

/* Which places are held at the first sample, and the signs of the others. */
void set_sides(Structure *structure, double time, const double *drive);

/* One step of a structure with dry friction, cut where a relative velocity changes sign, stops, or sets off. */
void structure_switching_step(Structure *structure, double time, double h, const double *drive);

#endif
