/*
 * A motion and its exact derivatives: of one coordinate or of several, of modes, or of the terms' own states alone
 * beside a motion that is prescribed.
 *
 * The states are displacements and velocities of the degrees of freedom, then the terms' own z. Registers of the
 * program: the time, what drives, the states, coefficients and shape parameters. It computes rows: the slopes of the
 * velocities and of the z, then whatever else is observed, each beside its partial derivatives by states and keys.
 *
 * Dry friction makes a force that is linear in the sign s of a relative velocity e.v. While a place moves, s is 1 or -1
 * and a step is cut where e.v vanishes; while it is held, s is whatever keeps e.a at zero, and it lets go where that
 * leaves [-1, 1]. What is held follows from all that is held together: (e da/ds) s = -e.a at s = 0.
 */

#ifndef STUDY_MOTION_H
#define STUDY_MOTION_H

#include "program.h"

#define FAR 1e150     /* of a motion: its square is still a number, its cube is not */
enum { WIDEST = 12 }; /* columns at once, which a processor keeps in its registers */

extern const double NO_DERIVATIVE; /* zero, of a row by what it does not depend on */

typedef struct {
    int64_t of;         /* state by which a row is differentiated */
    const double *from; /* register of the partial derivative */
} Partial;

typedef struct {
    int64_t places;           /* with dry friction */
    const int64_t *sides;     /* registers of the signs */
    const int64_t *by_side;   /* registers of the rows' derivatives by each */
    const double *directions; /* the e of each place, by degree of freedom */
    const int64_t *shifts;    /* registers of what is prescribed of its displacement, velocity, acceleration; or -1 */
    int64_t held_any, alone;  /* any place held; and it is the one of the one degree of freedom: its velocity stays */
    int64_t *held, *fresh;
    double *begun;                           /* state where a step that is cut began, */
    double *early, *early_motion;            /* and signs, relative displacements and velocities there */
    double *local;                           /* three rows of the drive, of a part of a step */
    double *matrix, *right, *before, *slope; /* room */
} Friction;

/*
 * States are rows of `columns` numbers: the value, its derivatives by keys and by states at the beginning; filled up
 * to a `width` that is even: two numbers at once are then of one row. A step begins in `state`.
 */
typedef struct {
    Program program;
    int64_t dofs, states, columns, width, drives, rows;
    const double **direct;                      /* value, derivatives by keys, zeros: `width` registers a row */
    Partial *by_state;                          /* what is not always zero of the derivatives by states */
    int64_t *ends;                              /* where those of each row end in this list */
    double *state, *trial, *other, *sum;        /* states x width each */
    int64_t onto;                               /* stages are added to the state one by one; else their sum is */
    int64_t ran;                                /* the program has run at this state and time */
    int64_t length, done;                       /* instructions of the program, and operations of all steps so far */
    Friction friction;
} Motion;

/*
 * Room for a motion whose numbers of states, columns, drives, rows and places with friction stand in it, and its
 * program, whose registers `r` and instructions stay the caller's. `slots` has of each row its register, and those of its
 * derivatives. Returns 0 where there is no memory; what there is of the room is given back by `forget_motion`.
 */
int prepare_motion(
    Motion *m, const int64_t *code, int64_t count, int64_t split, int64_t inputs, int64_t first, double *r,
    const int64_t *slots, int64_t slot_width
);
void forget_motion(Motion *m);

/* What is observed where the program has run: rows of the states, then those that it computes; 0 if not finite. */
int observe(Motion *m, const int64_t *observed, int64_t count, double *out);

/* Program and held signs at `state`; time and drive of the last run if `drive` is 0. */
void run_here(Motion *m, double time, const double *drive);

/* One step of so many columns: all, or one. */
void step_on(Motion *m, double time, double h, const double *drive, int64_t columns);

/* Columns of a row that the program has computed, at these states. */
void row_of(const Motion *m, int64_t row, const double *at, double *to);

/* Held signs, and the program with them. */
void hold(Motion *m);

/* Slopes at these states where friction holds something, states x width, and the derivatives of the held signs. */
void held_slopes(Motion *m, const double *at, int64_t columns);

/* What the derivatives of the held signs add to those of a row. */
void add_held(const Motion *m, int64_t row, double *to);

/* Whether a row is the acceleration of a degree of freedom that friction holds to what never moves. */
int stands_still(const Motion *m, int64_t row);

/* Which places are held at the first sample, and the signs of the others. */
void set_sides(Motion *m, double time, const double *drive);

/* One step with dry friction, cut where a relative velocity changes sign, stops, or sets off. */
void switching_step(Motion *m, double time, double h, const double *drive);

#endif
