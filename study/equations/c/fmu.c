/*
 * A model as a unit for co-simulation by FMI 2.0 (Functional Mock-up Interface, Modelica Association, 2014): the
 * functions that a master calls. One library serves every model: its program stands in `resources/motion.bin`, written
 * by study/export/fmu.py, and its motion is that of motion.c, friction that sticks included.
 *
 * Value references are registers of the program below `inputs` (what drives, initial states, coefficients and shape
 * parameters), then the largest internal step, then what is observed.
 */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "motion.h"

typedef void *Component;
typedef unsigned int Reference;
typedef int Truth;
typedef int Status;
typedef const char *Text;
typedef struct {
    void (*log)(void *environment, Text instance, Status status, Text category, Text message, ...);
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*finished)(void *environment, Status status);
    void *environment;
} Callbacks;

enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING };
enum { SET_UP, INITIALISING, STEPPING, FAILED }; /* phases of an instance */
enum { ORDERS = 2 };                             /* of the derivatives of what drives that are taken */

/* The head of the file, in its order; the arrays follow it. */
typedef struct {
    int64_t version, count, split, inputs, first, registers, rows, slot_width, places, drives, dofs, states, observed;
} Head;

enum { VERSION = 1, LARGEST = 1 << 24 };

typedef struct {
    Head head;
    int64_t *code, *slots, *sides, *by_side, *shifts, *observed;
    double *start, *directions;     /* registers as they are given, and weights of what friction acts between */
    double *r;                      /* registers of the run */
    double *drive;                  /* three rows of a step */
    double *slopes;                 /* derivatives of what drives at `time`, ORDERS of each */
    double *out;                    /* what is observed at `time` */
    double time, largest, largest_given;
    int64_t phase, changed;         /* what drives has changed since the last step */
    Motion motion;
    Callbacks callbacks;
    char guid[40], *name;
} Unit;

static Status complain(const Unit *unit, Text message, double number) {
    if (unit->callbacks.log)
        unit->callbacks.log(unit->callbacks.environment, unit->name, ERROR, "logStatusError", message, number);
    return ERROR;
}

static int hex_of(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* The file beside the library: a location is a URI, in which characters may be written as %20. */
static FILE *open_program(Text location) {
    static const char NAME[] = "/motion.bin";
    if (!location) return 0;
    if (!strncmp(location, "file:", 5)) {
        location += 5;
        if (!strncmp(location, "//", 2)) {
            location += 2;
            while (*location && *location != '/') location++; /* the host, which is this one */
        }
        if (location[0] == '/' && location[1] && location[2] == ':') location++; /* /C:/ */
    }
    char *path = malloc(strlen(location) + sizeof NAME), *to = path;
    if (!path) return 0;
    while (*location) {
        int high = location[0] == '%' ? hex_of(location[1]) : -1, low = high >= 0 ? hex_of(location[2]) : -1;
        *to++ = low >= 0 ? (char)(16 * high + low) : *location;
        location += low >= 0 ? 3 : 1;
    }
    memcpy(to, NAME, sizeof NAME);
    FILE *file = fopen(path, "rb");
    free(path);
    return file;
}

static void *read_array(FILE *file, int64_t count) {
    void *array = malloc((size_t)(count + 1) * sizeof(int64_t)); /* a double takes as much */
    if (array && fread(array, sizeof(int64_t), (size_t)count, file) == (size_t)count) return array;
    free(array);
    return 0;
}

static int read_program(Unit *unit, FILE *file) {
    Head *h = &unit->head;
    if (fread(unit->guid, 1, sizeof unit->guid, file) != sizeof unit->guid) return 0;
    if (fread(h, sizeof *h, 1, file) != 1 || h->version != VERSION) return 0;
    const int64_t *sizes = &h->count;
    for (size_t i = 0; i + 1 < sizeof *h / sizeof(int64_t); i++)
        if (sizes[i] < 0 || sizes[i] > LARGEST) return 0;
    return (unit->code = read_array(file, 3 * h->count)) && (unit->slots = read_array(file, h->rows * h->slot_width)) &&
           (unit->sides = read_array(file, h->places)) && (unit->by_side = read_array(file, h->places * h->rows)) &&
           (unit->shifts = read_array(file, 3 * h->places)) && (unit->observed = read_array(file, h->observed)) &&
           (unit->start = read_array(file, h->registers)) &&
           (unit->directions = read_array(file, h->places * h->dofs)) &&
           fread(&unit->largest_given, sizeof(double), 1, file) == 1;
}

static void stop(Unit *unit) {
    forget_motion(&unit->motion);
    memset(&unit->motion, 0, sizeof unit->motion);
}

static void begin_anew(Unit *unit) {
    const Head *h = &unit->head;
    stop(unit);
    memcpy(unit->r, unit->start, (size_t)h->registers * sizeof(double));
    memset(unit->slopes, 0, (size_t)(h->drives * ORDERS + 1) * sizeof(double));
    unit->time = 0.0;
    unit->largest = unit->largest_given;
    unit->phase = SET_UP;
    unit->changed = 0;
}

/* What drives, `ahead` seconds after the beginning of a step. */
static void drive_at(const Unit *unit, double ahead, double *row) {
    for (int64_t c = 0; c < unit->head.drives; c++) {
        const double *slope = unit->slopes + ORDERS * c;
        row[c] = unit->drive[c] + ahead * (slope[0] + 0.5 * ahead * slope[1]);
    }
}

/* What is observed now, from what drives now. */
static Status observe_now(Unit *unit) {
    run_here(&unit->motion, unit->time, unit->drive);
    unit->changed = 0;
    if (observe(&unit->motion, unit->observed, unit->head.observed, unit->out)) return OK;
    unit->phase = FAILED;
    return complain(unit, "the motion is not finite at %g s; expected other values, or a smaller 'step'", unit->time);
}

/* The motion with the values that were set: the program leaves out what does not change from here on. */
static Status start_motion(Unit *unit) {
    const Head *h = &unit->head;
    Motion *m = &unit->motion;
    stop(unit);
    *m = (Motion){.dofs = h->dofs, .states = h->states, .columns = 1, .drives = h->drives, .rows = h->rows, .onto = 1};
    m->friction = (Friction){.places = h->places, .sides = unit->sides, .by_side = unit->by_side,
                             .directions = unit->directions, .shifts = unit->shifts};
    if (!prepare_motion(m, unit->code, h->count, h->split, h->inputs, h->first, unit->r, unit->slots, h->slot_width))
        return complain(unit, "there is no memory for a motion", 0.0);
    for (int64_t i = 0; i < h->states; i++) m->state[i] = unit->r[1 + h->drives + i];
    for (int64_t c = 0; c < h->drives; c++) unit->drive[c] = unit->r[1 + c];
    if (h->places) set_sides(m, unit->time, unit->drive);
    return observe_now(unit);
}

static Status advance(Unit *unit, double interval) {
    const Head *h = &unit->head;
    Motion *m = &unit->motion;
    double begun = unit->time, *rows = unit->drive + h->drives, count = ceil(interval / unit->largest * (1.0 - 1e-12));
    int64_t steps = count < 1.0 ? 1 : (int64_t)count;
    double length = interval / (double)steps;
    if (unit->changed) run_here(m, begun, unit->drive); /* what drives may jump: friction has to hold against it */
    m->ran = m->ran && m->states > 0;
    for (int64_t step = 0; step < steps; step++) {
        double ahead = (double)step * length;
        drive_at(unit, ahead, rows);
        drive_at(unit, ahead + 0.5 * length, rows + h->drives);
        drive_at(unit, ahead + length, rows + 2 * h->drives);
        if (h->places)
            switching_step(m, begun + ahead, length, rows);
        else if (h->states)
            step_on(m, begun + ahead, length, rows, 1);
    }
    memcpy(unit->drive, rows + 2 * h->drives, (size_t)h->drives * sizeof(double));
    memset(unit->slopes, 0, (size_t)(h->drives * ORDERS + 1) * sizeof(double));
    unit->time = begun + interval;
    return observe_now(unit);
}

EXPORT Text fmi2GetTypesPlatform(void) { return "default"; }

EXPORT Text fmi2GetVersion(void) { return "2.0"; }

EXPORT Status fmi2SetDebugLogging(Component c, Truth on, size_t count, const Text categories[]) {
    (void)c, (void)on, (void)count, (void)categories;
    return OK;
}

EXPORT void fmi2FreeInstance(Component c) {
    Unit *unit = c;
    if (!unit) return;
    stop(unit);
    void *all[] = {unit->code, unit->slots, unit->sides, unit->by_side, unit->shifts, unit->observed, unit->start,
                   unit->directions, unit->r, unit->drive, unit->slopes, unit->out, unit->name};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
    free(unit);
}

EXPORT Component fmi2Instantiate(
    Text name, int type, Text guid, Text location, const Callbacks *callbacks, Truth visible, Truth logging
) {
    (void)visible, (void)logging;
    Unit *unit = calloc(1, sizeof *unit);
    if (!unit) return 0;
    if (callbacks) unit->callbacks = *callbacks;
    unit->name = calloc(strlen(name ? name : "") + 1, 1);
    if (unit->name && name) strcpy(unit->name, name);
    FILE *file = open_program(location);
    int read = file && read_program(unit, file);
    if (file) fclose(file);
    const Head *h = &unit->head;
    if (read) {
        unit->r = calloc((size_t)h->registers + 1, sizeof(double));
        unit->drive = calloc((size_t)(4 * h->drives + 1), sizeof(double));
        unit->slopes = calloc((size_t)(h->drives * ORDERS + 1), sizeof(double));
        unit->out = calloc((size_t)h->observed + 1, sizeof(double));
    }
    Text wrong = !unit->name || (read && !(unit->r && unit->drive && unit->slopes && unit->out)) ? "there is no memory"
                 : type != 1       ? "this unit is for co-simulation; expected the type fmi2CoSimulation"
                 : !read           ? "resources/motion.bin cannot be read; expected it as study export has written it"
                 : strncmp(unit->guid, guid ? guid : "", sizeof unit->guid)
                     ? "the GUID is not that of resources/motion.bin; expected both of one export"
                     : 0;
    if (wrong) {
        complain(unit, wrong, 0.0);
        fmi2FreeInstance(unit);
        return 0;
    }
    begin_anew(unit);
    return unit;
}

EXPORT Status fmi2SetupExperiment(
    Component c, Truth tolerant, double tolerance, double start, Truth stops, double stop_time
) {
    (void)tolerant, (void)tolerance, (void)stops, (void)stop_time;
    ((Unit *)c)->time = start;
    return OK;
}

EXPORT Status fmi2EnterInitializationMode(Component c) {
    ((Unit *)c)->phase = INITIALISING;
    return OK;
}

EXPORT Status fmi2ExitInitializationMode(Component c) {
    Unit *unit = c;
    if (!(unit->largest > 0.0)) return complain(unit, "the parameter 'step' is %g s; expected one above zero", unit->largest);
    unit->phase = STEPPING;
    return start_motion(unit);
}

EXPORT Status fmi2Terminate(Component c) {
    (void)c;
    return OK;
}

EXPORT Status fmi2Reset(Component c) {
    begin_anew(c);
    return OK;
}

EXPORT Status fmi2SetReal(Component c, const Reference at[], size_t count, const double values[]) {
    Unit *unit = c;
    const Head *h = &unit->head;
    for (size_t i = 0; i < count; i++) {
        int64_t which = at[i], observed = which - h->inputs - 1;
        int drives = which >= 1 && which <= h->drives;
        if (observed >= 0 && observed < h->observed && unit->observed[observed] < h->states)
            which = 1 + h->drives + unit->observed[observed]; /* the initial value of a state that is observed */
        if (which < 1 || which > h->inputs || (!drives && unit->phase >= STEPPING))
            return complain(unit, "value reference %.0f cannot be set now; expected inputs, or parameters before a run",
                            (double)at[i]);
        if (which == h->inputs)
            unit->largest = values[i];
        else
            unit->r[which] = values[i];
        if (drives) {
            unit->drive[which - 1] = values[i];
            memset(unit->slopes + ORDERS * (which - 1), 0, ORDERS * sizeof(double));
            unit->changed = 1;
        }
    }
    return OK;
}

EXPORT Status fmi2GetReal(Component c, const Reference at[], size_t count, double values[]) {
    Unit *unit = c;
    const Head *h = &unit->head;
    if (unit->phase == INITIALISING && !unit->motion.state) { /* what is observed depends on what was set until now */
        Status status = start_motion(unit);
        if (status != OK) return status;
    }
    if (unit->phase == STEPPING && unit->changed) { /* an acceleration follows what drives at once */
        Status status = observe_now(unit);
        if (status != OK) return status;
    }
    for (size_t i = 0; i < count; i++) {
        int64_t which = at[i], observed = which - h->inputs - 1, state = which - 1 - h->drives;
        if (which > h->inputs + h->observed) return complain(unit, "there is no value reference %.0f", (double)at[i]);
        if (observed >= 0)
            values[i] = unit->out[observed];
        else if (which == h->inputs)
            values[i] = unit->largest;
        else if (which >= 1 && which <= h->drives && unit->phase >= STEPPING)
            values[i] = unit->drive[which - 1];
        else if (state >= 0 && state < h->states && unit->motion.state)
            values[i] = unit->motion.state[state];
        else
            values[i] = unit->r[which];
    }
    if (unit->phase == INITIALISING) stop(unit); /* more may be set */
    return OK;
}

EXPORT Status fmi2SetRealInputDerivatives(
    Component c, const Reference at[], size_t count, const int orders[], const double values[]
) {
    Unit *unit = c;
    for (size_t i = 0; i < count; i++) {
        if (at[i] < 1 || at[i] > unit->head.drives || orders[i] < 1 || orders[i] > ORDERS)
            return complain(unit, "a derivative of value reference %.0f cannot be set; expected an input, order 1 or 2",
                            (double)at[i]);
        unit->slopes[ORDERS * (at[i] - 1) + orders[i] - 1] = values[i];
    }
    return OK;
}

EXPORT Status fmi2DoStep(Component c, double now, double interval, Truth kept) {
    Unit *unit = c;
    (void)kept;
    if (unit->phase != STEPPING) return complain(unit, "a step before the initialisation, or after an error", 0.0);
    if (!(interval >= 0.0)) return complain(unit, "the step is %g s; expected one of zero or more", interval);
    unit->time = now;
    return interval > 0.0 ? advance(unit, interval) : OK;
}

EXPORT Status fmi2GetRealOutputDerivatives(
    Component c, const Reference at[], size_t count, const int orders[], double values[]
) {
    (void)at, (void)count, (void)orders, (void)values;
    return complain(c, "derivatives of outputs are not offered", 0.0);
}

EXPORT Status fmi2CancelStep(Component c) { return complain(c, "no step is ever pending", 0.0); }

/* Variables of other types: there are none. */
#define NONE_OF(type, name)                                                                                    \
    EXPORT Status fmi2Get##name(Component c, const Reference at[], size_t count, type values[]) {              \
        (void)at, (void)values;                                                                                \
        return count ? complain(c, "every variable of this unit is real", 0.0) : OK;                           \
    }                                                                                                          \
    EXPORT Status fmi2Set##name(Component c, const Reference at[], size_t count, const type values[]) {        \
        (void)at, (void)values;                                                                                \
        return count ? complain(c, "every variable of this unit is real", 0.0) : OK;                           \
    }
NONE_OF(int, Integer)
NONE_OF(Truth, Boolean)
NONE_OF(Text, String)

/* What the description of the unit says that it cannot do. */
#define REFUSED(name, ...)                                                                       \
    EXPORT Status fmi2##name(Component c, __VA_ARGS__) {                                         \
        return complain(c, "fmi2" #name " is not offered, as the description of this unit says", 0.0); \
    }
REFUSED(GetFMUstate, void **state)
REFUSED(SetFMUstate, void *state)
REFUSED(FreeFMUstate, void **state)
REFUSED(SerializedFMUstateSize, void *state, size_t *size)
REFUSED(SerializeFMUstate, void *state, char bytes[], size_t size)
REFUSED(DeSerializeFMUstate, const char bytes[], size_t size, void **state)
REFUSED(
    GetDirectionalDerivative, const Reference unknown[], size_t unknowns, const Reference known[], size_t knowns,
    const double seed[], double values[]
)
REFUSED(GetStatus, int kind, Status *value)
REFUSED(GetRealStatus, int kind, double *value)
REFUSED(GetIntegerStatus, int kind, int *value)
REFUSED(GetBooleanStatus, int kind, Truth *value)
REFUSED(GetStringStatus, int kind, Text *value)
