/*
 * Motions by Runge-Kutta with their sensitivities s: ds/dt = (df/dx) s + df/dp, of which the columns beyond those of
 * the p are those of the initial state. Runge-Kutta applied to them gives exactly the derivative of its own map.
 */

#include "two_motions.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SUMMED, ONE_BY_ONE, ADAMS }; /* methods, as in kernels.py */
#define EACH_WIDTH(DO) DO(2) DO(4) DO(6) DO(8) DO(10) DO(12)

const double NO_DERIVATIVE = 0.0;

/*
 * Where a motion dies away its derivatives fall below 1e-308, where a number has no full mantissa any more and an
 * operation takes up to a hundred times as long. While this runs such a number is zero.
 */
#if defined(__SSE2__) || defined(_M_X64)
#include <xmmintrin.h>
typedef unsigned int Rounding;
static Rounding rounding(void) { return _mm_getcsr(); }
static void set_rounding(Rounding mode) { _mm_setcsr(mode); }
#define TINY_IS_ZERO 0x8040 /* what comes out, what goes in */
#elif defined(__aarch64__) && defined(__GNUC__)
typedef uint64_t Rounding;
static Rounding rounding(void) {
    Rounding mode;
    __asm__ volatile("mrs %0, fpcr" : "=r"(mode));
    return mode;
}
static void set_rounding(Rounding mode) { __asm__ volatile("msr fpcr, %0" : : "r"(mode)); }
#define TINY_IS_ZERO 0x1000000
#else
typedef int Rounding;
static Rounding rounding(void) { return 0; }
static void set_rounding(Rounding mode) { (void)mode; }
#define TINY_IS_ZERO 0
#endif

/*
 * The functions below are written out for each small width: the compiler then leaves out the loops over a row and keeps
 * it in the processor's registers. A wider row is treated in parts. A pair of columns is one operation: left to itself
 * a compiler sees that of some rows, and not of others.
 */
static inline Pair plus(Pair a, double by, Pair b) { return plus_product(a, pair(by, by), b); }
static inline Pair with_first(Pair a, double first) { return pair(first, second_of(a)); }

static inline double *register_of(const Motion *m, int64_t state) { return m->program.r + 1 + m->drives + state; }

static inline void drive_registers(const Motion *m, double time, const double *drive) {
    double *r = m->program.r;
    r[0] = time;
    for (int64_t c = 0; c < m->drives; c++) r[1 + c] = drive[c];
}

/* Columns of a row, from `first` on, where the program has run at the states `at`. */
static inline void computed(
    const Motion *m, int64_t row, const double *at, Pair *restrict to, int64_t width, int64_t first, int64_t pairs
) {
    const double *const *direct = m->direct + row * width + first;
    const Partial *state = m->by_state + m->ends[row], *last_state = m->by_state + m->ends[row + 1];
    for (int64_t c = 0; c < pairs; c++) to[c] = pair(*direct[2 * c], *direct[2 * c + 1]);
    for (; state < last_state; state++) {
        double by = *state->from;
        const Pair *row_of_state = (const Pair *)(at + state->of * width + first);
        for (int64_t c = 0; c < pairs; c++) to[c] = plus(to[c], by, row_of_state[c]);
    }
    if (first == 0) to[0] = with_first(to[0], *direct[0]);
}

/* The same of the slope of a state. */
static inline void slope_of(
    const Motion *m, int64_t i, const double *at, Pair *restrict to, int64_t width, int64_t first, int64_t pairs
) {
    const Pair *velocity = (const Pair *)(at + (m->dofs + i) * width + first);
    if (i < m->dofs)
        for (int64_t c = 0; c < pairs; c++) to[c] = velocity[c];
    else if (i == m->dofs && m->friction.alone)
        for (int64_t c = 0; c < pairs; c++) to[c] = pair(0.0, 0.0);
    else
        computed(m, i - m->dofs, at, to, width, first, pairs);
}

/* The slope itself, without derivatives. */
static inline double slope_alone(const Motion *m, int64_t i, const double *at, int64_t width) {
    if (i < m->dofs) return at[(m->dofs + i) * width];
    return i == m->dofs && m->friction.alone ? 0.0 : *m->direct[(i - m->dofs) * width];
}

/* The same of all states where friction holds something: each slope depends on all others. */
static void advance_held(Motion *m, const double *at, double *next, double weight, double ahead, int64_t count) {
    held_slopes(m, at, count);
    for (int64_t i = 0; i < m->states; i++) {
        for (int64_t c = i * m->width; c < i * m->width + count; c++) {
            m->sum[c] += weight * m->friction.slope[c];
            next[c] = m->state[c] + ahead * m->friction.slope[c];
        }
        *register_of(m, i) = next[i * m->width];
    }
}

/* Columns of a state in one stage of a step: slopes at `at`, added to the sum, and the next trial. */
static inline void advance(
    Motion *m, int64_t i, const double *at, double *next, double weight, double ahead, int64_t width, int64_t first,
    int64_t count
) {
    int64_t begin = i * width + first, pairs = count / 2;
    if (count == 1) {
        double slope = slope_alone(m, i, at, width);
        m->sum[begin] += weight * slope;
        *register_of(m, i) = next[begin] = m->state[begin] + ahead * slope;
        return;
    }
    Pair slope[WIDEST / 2] = {{0.0, 0.0}};
    Pair *restrict sum = (Pair *)(m->sum + begin), *restrict to = (Pair *)(next + begin);
    const Pair *restrict state = (const Pair *)(m->state + begin);
    slope_of(m, i, at, slope, width, first, pairs);
    if (first == 0) *register_of(m, i) = first_of(plus(state[0], ahead, slope[0]));
    for (int64_t c = 0; c < pairs; c++) {
        sum[c] = plus(sum[c], weight, slope[c]);
        to[c] = plus(state[c], ahead, slope[c]);
    }
}

/*
 * One stage of a step: slopes at `at`, whose state the registers hold, added to the sum; the next trial and the
 * registers of its state follow. What was just computed goes on in the processor, not by way of the memory.
 */
static inline void stage_of(
    Motion *m, double time, const double *drive, const double *at, double *next, double weight, double ahead,
    int64_t width, int64_t count
) {
    int64_t together = m->friction.held_any && !m->friction.alone;
    if (!m->ran) {
        drive_registers(m, time, drive);
        if (together)
            hold(m);
        else
            run_prepared(&m->program);
    }
    if (together) {
        advance_held(m, at, next, weight, ahead, count);
        return;
    }
    for (int64_t i = 0; i < m->states; i++) {
        int64_t first = 0;
        if (count <= WIDEST) {
            advance(m, i, at, next, weight, ahead, width, 0, count);
            continue;
        }
        for (; count - first > WIDEST; first += WIDEST) advance(m, i, at, next, weight, ahead, width, first, WIDEST);
        switch (count - first) {
#define REST(columns)                                                  \
    case columns:                                                      \
        advance(m, i, at, next, weight, ahead, width, first, columns); \
        break;
            EACH_WIDTH(REST)
        }
    }
}

static inline void step_of(Motion *m, double time, double h, const double *drive, int64_t width, int64_t count) {
    double half = h * 0.5, third = h / 3.0, sixth = h / 6.0;
    m->done += 4 * (m->length + m->states * count);
    if (!m->ran)
        for (int64_t i = 0; i < m->states; i++) *register_of(m, i) = m->state[i * width];
    for (int64_t i = 0; i < m->states; i++)
        for (int64_t c = i * width; c < i * width + count; c++) m->sum[c] = m->onto ? m->state[c] : 0.0;
    stage_of(m, time, drive, m->state, m->trial, sixth, half, width, count);
    m->ran = 0;
    stage_of(m, time + half, drive + m->drives, m->trial, m->other, third, half, width, count);
    stage_of(m, time + half, drive + m->drives, m->other, m->trial, third, h, width, count);
    stage_of(m, time + h, drive + 2 * m->drives, m->trial, m->other, sixth, half, width, count);
    for (int64_t i = 0; i < m->states; i++)
        for (int64_t c = i * width; c < i * width + count; c++)
            m->state[c] = m->onto ? m->sum[c] : m->state[c] + m->sum[c];
}

void step_on(Motion *m, double time, double h, const double *drive, int64_t columns) {
    if (columns == 1) {
        step_of(m, time, h, drive, m->width, 1);
        return;
    }
    switch (m->width) {
#define STEP(width)                               \
    case width:                                   \
        step_of(m, time, h, drive, width, width); \
        return;
        EACH_WIDTH(STEP)
    default:
        step_of(m, time, h, drive, m->width, m->width);
    }
}

void row_of(const Motion *m, int64_t row, const double *at, double *to) {
    const double *const *direct = m->direct + row * m->width;
    const Partial *state = m->by_state + m->ends[row], *last_state = m->by_state + m->ends[row + 1];
    for (int64_t c = 0; c < m->columns; c++) to[c] = *direct[c];
    for (; state < last_state; state++) {
        double by = *state->from;
        for (int64_t c = 1; c < m->columns; c++) to[c] += by * at[state->of * m->width + c];
    }
}

void run_here(Motion *m, double time, const double *drive) {
    for (int64_t i = 0; i < m->states; i++) *register_of(m, i) = m->state[i * m->width];
    if (drive) drive_registers(m, time, drive);
    if (m->friction.held_any)
        hold(m);
    else
        run_prepared(&m->program);
    m->ran = 1;
}

int observe(Motion *m, const int64_t *observed, int64_t count, double *out) {
    int64_t own = 0;
    for (int64_t i = 0; i < m->dofs; i++)
        if (!(fabs(m->state[i * m->width]) < FAR && fabs(m->state[(m->dofs + i) * m->width]) < FAR &&
              isfinite(*m->direct[i * m->width])))
            return 0;
    for (int64_t k = 0; k < count; k++) own += observed[k] >= m->states;
    if (own) run_rest(&m->program);
    if (own && m->friction.held_any) held_slopes(m, m->state, m->columns);
    for (int64_t k = 0; k < count; k++, out += m->columns) {
        if (observed[k] < m->states) {
            memcpy(out, m->state + observed[k] * m->width, (size_t)m->columns * sizeof(double));
            continue;
        }
        if (m->friction.held_any && stands_still(m, observed[k] - m->states)) {
            memset(out, 0, (size_t)m->columns * sizeof(double)); /* to the last bit, as what is at rest is measured */
            continue;
        }
        row_of(m, observed[k] - m->states, m->state, out);
        if (m->friction.held_any) add_held(m, observed[k] - m->states, out);
        if (!isfinite(out[0])) return 0;
    }
    return 1;
}

/* From the `first` sample on, at which the state is that of `m`. */
static int64_t along_runge_kutta(
    Motion *m, double start, double dt, int64_t steps, const double *drive, const int64_t *observed, int64_t count,
    int64_t first, int64_t samples, double *out
) {
    double h = dt / (double)steps;
    m->ran = 0;
    if (m->friction.places) set_sides(m, start, drive);
    for (int64_t sample = first; sample < samples; sample++) {
        const double *at = drive + 2 * steps * sample * m->drives;
        if (!m->ran) run_here(m, start + (double)sample * dt, at);
        if (!observe(m, observed, count, out + sample * count * m->columns)) return sample;
        if (sample + 1 == samples) break;
        m->ran = m->ran && m->states > 0; /* without states nothing steps on, and the drive alone does */
        for (int64_t s = 0; s < steps && m->states > 0; s++) {
            double time = start + (double)sample * dt + (double)s * h;
            const double *now = at + 2 * s * m->drives;
            if (m->friction.places)
                switching_step(m, time, h, now);
            else
                step_on(m, time, h, now, m->columns);
        }
    }
    return ALL_FINITE;
}

/* Adams-Bashforth predictor, Adams-Moulton corrector of order 4 (PECE) without derivatives, started by Runge-Kutta. */
static int64_t along_adams(
    Motion *m, double start, double dt, int64_t steps, const double *drive, const int64_t *observed, int64_t count,
    int64_t samples, double *out
) {
    int64_t n = m->states, total = (samples - 1) * steps;
    double h = dt / (double)steps, *late = m->sum, *ring = m->other + n; /* of four rows, which nothing else needs */
    for (int64_t step = 0; step <= total; step++) {
        double time = start + (double)step * h;
        double *f0 = ring + (step & 3) * n, *f1 = ring + ((step + 3) & 3) * n; /* slopes of this step and the last */
        double *f2 = ring + ((step + 2) & 3) * n, *f3 = ring + ((step + 1) & 3) * n;
        const double *now = drive + 2 * step * m->drives;
        run_here(m, time, now);
        for (int64_t i = 0; i < n; i++) f0[i] = slope_alone(m, i, m->state, 1);
        if (step % steps == 0 && !observe(m, observed, count, out + step / steps * count)) return step / steps;
        if (step == total) break;
        if (step < 3) {
            step_on(m, time, h, now, 1);
            continue;
        }
        for (int64_t i = 0; i < n; i++) {
            double past = -59.0 * f1[i] + 37.0 * f2[i] - 9.0 * f3[i];
            *register_of(m, i) = m->trial[i] = m->state[i] + h / 24.0 * (55.0 * f0[i] + past);
        }
        drive_registers(m, time + h, now + 2 * m->drives);
        run_prepared(&m->program);
        for (int64_t i = 0; i < n; i++) late[i] = slope_alone(m, i, m->trial, 1);
        for (int64_t i = 0; i < n; i++) {
            double past = 19.0 * f0[i] - 5.0 * f1[i] + f2[i];
            m->state[i] += h / 24.0 * (9.0 * late[i] + past);
        }
    }
    return ALL_FINITE;
}

void forget_motion(Motion *m) {
    forget_program(&m->program);
    free(m->direct);
    free(m->by_state);
    free(m->ends);
    free(m->state);
    free(m->friction.held);
}

/*
 * Where rows and derivatives are read; `slots` has of each row its register, those of its derivatives by the states and
 * by the keys. What is a constant zero, below `first` but no input, is left out.
 */
static void find_derivatives(Motion *m, const int64_t *slots, int64_t slot_width, int64_t inputs, int64_t first) {
    const double *r = m->program.r;
    int64_t states = 0;
    m->ends[0] = 0;
    for (int64_t row = 0; row < m->rows; row++, slots += slot_width) {
        const double **direct = m->direct + row * m->width;
        direct[0] = r + slots[0];
        for (int64_t c = 1; c < m->width; c++) direct[c] = &NO_DERIVATIVE;
        for (int64_t i = 1; i < slot_width; i++) {
            int64_t at = slots[i], key = i - m->states;
            if (at >= inputs && at < first && r[at] == 0.0) continue;
            if (i <= m->states)
                m->by_state[states++] = (Partial){i - 1, r + at};
            else if (key < m->columns)
                direct[key] = r + at;
        }
        m->ends[row + 1] = states;
    }
}

static int prepare_room(Motion *m) {
    m->width = m->columns == 1 ? 1 : m->columns + m->columns % 2;
    Friction *f = &m->friction;
    size_t states = (size_t)m->states, rows = (size_t)m->rows, width = (size_t)m->width, size = states * width;
    size_t places = (size_t)f->places, of_friction = places * (places + width + 3) + 2 * size + (size_t)m->dofs;
    m->direct = malloc((rows * width + 1) * sizeof(double *));
    m->by_state = malloc((rows * states + 1) * sizeof(Partial));
    m->ends = malloc((rows + 1) * sizeof(int64_t));
    m->state = calloc(4 * size + 4 * states + 3 * (size_t)m->drives + of_friction, sizeof(double));
    f->held = calloc(2 * places + 1, sizeof(int64_t));
    if (!m->direct || !m->by_state || !m->ends || !m->state || !f->held) return 0;
    m->trial = m->state + size;
    m->sum = m->trial + size;
    m->other = m->sum + size; /* and four rows of one column more, for the slopes of an Adams method */
    f->begun = m->other + size + 4 * states;
    f->slope = f->begun + size;
    f->local = f->slope + size;
    f->early = f->local + 3 * m->drives;
    f->early_motion = f->early + places;
    f->matrix = f->early_motion + 2 * places;
    f->right = f->matrix + places * places;
    f->before = f->right + places * width;
    f->fresh = f->held + places;
    return 1;
}

/*
 * Which registers are read, and what they are computed from: rows, their derivatives where there are columns for these,
 * and what friction needs. The caller frees the flags; 0 where there is no memory.
 */
static char *find_needed(
    const Motion *m, const int64_t *code, int64_t count, int64_t first, const int64_t *slots, int64_t slot_width
) {
    const Friction *f = &m->friction;
    char *needed = calloc((size_t)(first + count + 1), 1);
    int64_t read = m->columns == 1 ? 1 : slot_width;
    if (!needed) return 0;
    for (int64_t row = 0; row < m->rows; row++)
        for (int64_t i = 0; i < read; i++) needed[slots[row * slot_width + i]] = 1;
    for (int64_t i = 0; i < f->places * m->rows; i++) needed[f->by_side[i]] = 1;
    for (int64_t i = 0; i < 3 * f->places; i++)
        if (f->shifts[i] >= 0) needed[f->shifts[i]] = 1;
    for (int64_t i = count - 1; i >= 0; i--)
        if (needed[first + i]) needed[code[3 * i + 1]] = needed[code[3 * i + 2]] = 1;
    return needed;
}

int prepare_motion(
    Motion *m, const int64_t *code, int64_t count, int64_t split, int64_t inputs, int64_t first, double *r,
    const int64_t *slots, int64_t slot_width
) {
    const Friction *f = &m->friction;
    int64_t changing = 1 + m->drives + m->states;
    if (!prepare_room(m)) return 0;
    char *needed = find_needed(m, code, count, first, slots, slot_width);
    if (!needed) return 0;
    int ready = prepare_program(&m->program, code, count, split, first, r, changing, f->sides, f->places, needed);
    free(needed);
    if (!ready) return 0;
    find_derivatives(m, slots, slot_width, inputs, first);
    return 1;
}

/* What `integrate` is told of all motions, and where each stands in it. */
typedef struct {
    Motion m;
    int64_t method, steps, runs, observations, samples;
    const int64_t *bounds, *observed;
    const double *starts, *drive;
    double dt, *states, *out;
    double *last; /* of the last motion, where its last sample is another thread's; else 0 */
} Motions;

static int64_t length_of(const Motions *all, int64_t run) {
    int64_t end = all->bounds[run + 1] + 1 < all->samples ? all->bounds[run + 1] + 1 : all->samples;
    return end - all->bounds[run];
}

static double *target_of(const Motions *all, int64_t run) {
    if (all->last && run + 1 == all->runs) return all->last;
    return all->out + all->bounds[run] * all->observations * all->m.columns;
}

static const double *drive_of(const Motions *all, int64_t run) {
    return all->drive + 2 * all->steps * all->bounds[run] * all->m.drives;
}

static double *states_of(const Motions *all, int64_t run) { return all->states + run * all->m.states * all->m.columns; }

/* One motion from a sample of it on, at which it has its states; which of all samples is not finite. */
static int64_t along(Motions *all, int64_t run, int64_t first) {
    Motion *m = &all->m;
    size_t of_row = (size_t)m->columns * sizeof(double);
    double *y = states_of(all, run);
    for (int64_t s = 0; s < m->states; s++) memcpy(m->state + s * m->width, y + s * m->columns, of_row);
    int64_t failed =
        all->method == ADAMS
            ? along_adams(m, all->starts[run], all->dt, all->steps, drive_of(all, run), all->observed,
                          all->observations, length_of(all, run), target_of(all, run))
            : along_runge_kutta(m, all->starts[run], all->dt, all->steps, drive_of(all, run), all->observed,
                                all->observations, first, length_of(all, run), target_of(all, run));
    for (int64_t s = 0; s < m->states; s++) memcpy(y + s * m->columns, m->state + s * m->width, of_row);
    return failed >= 0 ? failed + all->bounds[run] : failed;
}

/* A motion and the next at once as far as both go, then the longer alone; where one fails, one after the other. */
static int64_t along_two(Motions *all, TwoMotions *two, int64_t run, double *begun) {
    Motion *m = &all->m;
    int64_t one = length_of(all, run), other = length_of(all, run + 1), common = one < other ? one : other;
    int64_t failed, operations = 4 * (m->length + m->states * m->width) * all->steps * (common - 1);
    double *states[2] = {states_of(all, run), states_of(all, run + 1)};
    double *out[2] = {target_of(all, run), target_of(all, run + 1)};
    const double *drive[2] = {drive_of(all, run), drive_of(all, run + 1)};
    int both = along_both(two, states, all->starts + run, all->dt, all->steps, drive, all->observed, all->observations,
                          common, out, begun);
    m->done += both ? operations : 0;
    failed = both && one == common ? ALL_FINITE : along(all, run, both ? common - 1 : 0);
    if (failed != ALL_FINITE) return failed;
    m->done += both ? operations : 0;
    if (!both || other > common) failed = along(all, run + 1, both ? common - 1 : 0);
    if (both) memcpy(out[1], begun, (size_t)(all->observations * m->columns) * sizeof(double));
    return failed;
}

/*
 * Motions between neighbouring `bounds`, each from its own of the `states` and from its time in `starts`; the states
 * become those where it ends. A motion runs on to the first sample of the next, which overwrites it; the last one does
 * not write that sample, which another thread may own. `drive` has 2 `steps` rows a sample. `out`, shape (samples,
 * observations, columns), gets the rows that are `observed`: of the states, then of the program. Instructions from
 * `split` on are those of observations alone. `done` grows by what the steps took: instructions, and numbers of states.
 */
EXPORT int64_t integrate(
    int64_t method, const int64_t *code, int64_t count, int64_t split, int64_t inputs, int64_t first, double *r,
    const int64_t *slots, int64_t rows, int64_t slot_width, const int64_t *sides, int64_t places,
    const int64_t *by_side, const double *directions, const int64_t *shifts, const double *starts, double dt,
    int64_t steps, const double *drive, int64_t drives, const int64_t *bounds, int64_t bound_count, double *states,
    int64_t dofs, int64_t state_count, int64_t columns, const int64_t *observed, int64_t observed_count,
    int64_t samples, double *out, int64_t *done
) {
    Motions all = {.method = method, .steps = steps, .runs = bound_count - 1, .observations = observed_count,
                   .samples = samples, .bounds = bounds, .observed = observed, .starts = starts, .drive = drive,
                   .dt = dt, .states = states, .out = out};
    Motion *m = &all.m;
    *m = (Motion){.dofs = dofs, .states = state_count, .columns = columns, .drives = drives, .rows = rows,
                  .length = count, .onto = method != SUMMED};
    m->friction = (Friction){.places = places, .sides = sides, .by_side = by_side, .directions = directions,
                             .shifts = shifts};
    TwoMotions two = {0};
    int64_t failed = NO_MEMORY, of_sample = observed_count * columns, end = bounds[all.runs];
    int64_t of_last = length_of(&all, all.runs - 1) * of_sample;
    int at_once = all.runs > 1 && method != ADAMS && places == 0 && state_count > 0;
    double *room = malloc((size_t)(of_last + of_sample + 1) * sizeof(double)), *begun = room + of_last;
    if (end < samples) all.last = room; /* its last sample is another thread's: the motion is made beside `out` */
    Rounding before = rounding();
    set_rounding(before | TINY_IS_ZERO);
    if (room && prepare_motion(m, code, count, split, inputs, first, r, slots, slot_width) &&
        (!at_once || prepare_two(&two, m, first + count))) {
        failed = ALL_FINITE;
        for (int64_t i = 0; i < all.runs && failed == ALL_FINITE; i += 1 + at_once)
            failed = at_once && i + 1 < all.runs ? along_two(&all, &two, i, begun) : along(&all, i, 0);
        if (failed == ALL_FINITE && all.last)
            memcpy(out + bounds[all.runs - 1] * of_sample, room,
                   (size_t)((end - bounds[all.runs - 1]) * of_sample) * sizeof(double));
    }
    *done += m->done;
    set_rounding(before);
    free(room);
    forget_two(&two);
    forget_motion(m);
    return failed;
}
