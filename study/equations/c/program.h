/* Programs: straight-line code over one array of registers (see graph.py, whose numbers of instructions these are). */

#ifndef STUDY_PROGRAM_H
#define STUDY_PROGRAM_H

#include <stdint.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { END = 4 * 17 }; /* beyond the operations of graph.Op */
enum { ALL_FINITE = -1, NO_MEMORY = -2 }; /* what an integrator returns beside the first sample that is not finite */

#if defined(__GNUC__)
typedef const void *Operation; /* where it is written out */
#else
typedef int64_t Operation;
#endif

typedef struct {
    Operation op;
    const double *a, *b; /* registers of the operands */
    double *to;          /* and of the result */
} Instruction;

typedef struct {
    Instruction *code, *rest; /* without the instructions whose results never change; each ends with END */
    double *r;
    int64_t count;          /* of both, each END included, */
    unsigned char *numbers; /* and the numbers of their operations */
} Program;

/* Two numbers at once: an operation on both takes a processor no longer than one on a single number. */
#if defined(__GNUC__)
typedef double Pair __attribute__((vector_size(16), aligned(8), may_alias));
static inline Pair pair(double first, double second) { return (Pair){first, second}; }
static inline double first_of(Pair a) { return a[0]; }
static inline double second_of(Pair a) { return a[1]; }
static inline Pair plus_product(Pair a, Pair by, Pair b) { return a + by * b; }
#else
typedef struct {
    double first, second;
} Pair;
static inline Pair pair(double first, double second) { return (Pair){first, second}; }
static inline double first_of(Pair a) { return a.first; }
static inline double second_of(Pair a) { return a.second; }
static inline Pair plus_product(Pair a, Pair by, Pair b) {
    return pair(a.first + by.first * b.first, a.second + by.second * b.second);
}
#endif

/*
 * `count` instructions of three numbers each (operation, operands), the first of which writes register `first`, made
 * ready for many runs: what depends on nothing that changes is computed now and left out of the code. Registers below
 * `changing` change from run to run, and those in `others`. Left out too is what is not `needed`, a flag a register; 0
 * where all are. Instructions from `split` on are the `rest`, which runs by itself. Returns 0 where there is no memory.
 */
int prepare_program(
    Program *program, const int64_t *code, int64_t count, int64_t split, int64_t first, double *r, int64_t changing,
    const int64_t *others, int64_t other_count, const char *needed
);
void forget_program(Program *program);
void run_prepared(const Program *program);
void run_rest(const Program *program);

/*
 * A prepared program of twice the registers, a pair in place of each: both numbers of a register begin as that of the
 * other program. It is run by `run_pairs`, its rest by itself. Returns 0 where there is no memory.
 */
int prepare_pairs(Program *pairs, const Program *single, int64_t registers);
void run_pairs(const Instruction *code);

#endif
