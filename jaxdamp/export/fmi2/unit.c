/* FMI 2.0, model exchange and co-simulation, of a damper law, a vehicle or a controller. It stands behind the printed
 * functions `model_...`, behind checks.c, and behind law.c, vehicle.c or controller.c, which define PAIRS, RATES,
 * OUTPUTS, STATES, CARRY, MATRICES, RATES_GIVEN, prepare, start, resume, advance, observe and observe_derivative; GUID
 * is a text. What computes nothing is in services.c.
 *
 * Inputs come in pairs of a value and its rate: first all values, then all rates; those of a controller have no rates.
 * The carry of a run begins with the continuous states. Models with a PERIOD are sampled: for co-simulation only, and
 * the last number of the carry counts the steps since a sample.
 *
 * Co-simulation has no delay of a step. A step ends at inputs that the importer knows only afterwards: after fmi2DoStep
 * they are extrapolated (or follow from fmi2SetRealInputDerivatives), and as soon as the inputs of the new instant are
 * set, the states are those of the step between the true inputs. Numbers, commands among them, count from the instant
 * at which they are set; those of a law (NUMBERS_MOVE) go straight to it over the step before.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#define INPUTS (PAIRS + RATES)
enum { FIRST_OUTPUT = INPUTS, LONGEST_STEP = INPUTS + OUTPUTS, FIRST_NUMBER };
#define FIRST_STATE (FIRST_NUMBER + NUMBERS)
#define FIRST_RATE (FIRST_STATE + STATES)

typedef struct {
    const fmi2CallbackFunctions *functions; /* of the importer */
    model_parameters p;             /* now */
    model_parameters before;        /* over the step that ends now; with NUMBERS_MOVE at its beginning */
    double number_slope[NUMBERS];   /* rates given by the importer */
    double longest;                 /* s, longest step of the model; longer communication steps are divided */
    double matrices[MATRICES + 1];  /* what follows from the parameters and this step */
    double step;                    /* s */
    double carry[CARRY + 1];        /* at the beginning of the step that ends now */
    double end[CARRY + 1];          /* now */
    double input0[INPUTS], input[INPUTS]; /* at the beginning of the step and at its end */
    double used[INPUTS];            /* inputs now, with rates that follow from the values */
    double slope[INPUTS];           /* their rates, given by the importer */
    double slope_before[PAIRS];     /* of the values over the step before */
    int given[INPUTS];              /* whether the importer has given a rate */
    int guessed[INPUTS];            /* whether an input now is extrapolated */
    int rated[PAIRS];               /* whether rates are inputs; otherwise they follow from the values */
    double h;                       /* s, duration of the step; zero before the first and for model exchange */
    int steps;                      /* the number of steps done, up to two */
    int started;                    /* initialisation is over */
    int changed;                    /* parameters have changed since `matrices` was computed */
    int unchecked;                  /* numbers have changed since conditions between them were checked */
    int known;                      /* `end`, `used`, `rate` and `y` are up to date */
    double rate[STATES + 1], y[OUTPUTS]; /* of the states, and the outputs */
} Model;

static void set_defaults(Model *m, const fmi2CallbackFunctions *functions) {
    int k;
    memset(m, 0, sizeof *m);
    m->functions = functions;
    m->longest = DEFAULT_STEP;
    m->step = DEFAULT_STEP;
    m->changed = 1;
    for (k = 0; k < PAIRS; ++k) m->rated[k] = RATES_GIVEN;
    model_defaults(&m->p);
}

/* Rates at both ends of the step where they are no inputs: the mean of the slopes before and after its beginning, and
 * the slope extrapolated to its end. */
static void use_slopes(Model *m, double *u0) {
    int k;
    for (k = 0; k < RATES; ++k) {
        const double slope = (m->input[k] - m->input0[k]) / m->h;
        const double before = m->steps > 1 ? m->slope_before[k] : slope;
        if (m->rated[k]) continue;
        u0[PAIRS + k] = 0.5 * (before + slope);
        m->used[PAIRS + k] = 1.5 * slope - 0.5 * before;
    }
}

/* Steps of the model in a communication step from this carry on; zero if samples cannot lie between two of them. */
static int steps_in(const Model *m, const double *carry, double h) {
    int n = (int)ceil(h / m->longest - 1e-9);
    if (n < 1) n = 1;
#ifdef PERIOD
    {
        const double times[3] = {PERIOD, DELAY, carry[CARRY - 1] * m->step};
        const int most = 64 * n;
        for (; n <= most; ++n) {
            int k, whole = 1;
            for (k = 0; k < 3; ++k) {
                const double count = times[k] * n / h;
                whole = whole && fabs(count - floor(count + 0.5)) < 1e-6;
            }
            if (whole) return n;
        }
        return 0;
    }
#else
    UNUSED(carry);
    return n;
#endif
}

/* The states at the end of the step. */
static void refresh(Model *m) {
    const int n = m->h > 0.0 ? steps_in(m, m->carry, m->h) : 1;
    double u0[INPUTS], step;
    if (m->known) return;
    step = m->h > 0.0 ? m->h / n : m->step;
    memcpy(u0, m->input0, sizeof u0);
    memcpy(m->used, m->input, sizeof u0);
    if (m->h > 0.0) use_slopes(m, u0);
    if (m->h <= 0.0) m->before = m->p;
    if (m->changed || fabs(step - m->step) > 1e-9 * step) {
        prepare(&m->before, step, m->matrices);
        if (m->h > 0.0) resume(m->matrices, u0, step / m->step, m->carry);
        m->step = step;
        m->changed = 0;
    }
    if (!m->started) start(&m->p, m->matrices, m->input, m->carry);
    memcpy(m->end, m->carry, sizeof m->end);
    if (m->h > 0.0) advance(&m->before, &m->p, m->matrices, u0, m->used, m->h, n, m->end);
    observe(&m->p, m->matrices, m->end, m->used, m->rate, m->y);
    m->known = 1;
}

static fmi2Status refused(const Model *m, fmi2String why) {
    if (m->functions && m->functions->logger)
        m->functions->logger(m->functions->componentEnvironment, "model", fmi2Error, "logStatusError", why);
    return fmi2Error;
}

static fmi2Status lost(const Model *m, fmi2String what) {
    char why[TEXT];
    snprintf(why, TEXT, "%s is not a finite number. Inputs must be finite; laws steeper or wheels lighter than those "
             "exported need a longest_step shorter than %g s.", what, m->longest);
    return refused(m, why);
}

/* As `refresh`, if the numbers are allowed together. */
static fmi2Status computed(Model *m) {
    char why[TEXT];
    if (m->unchecked && is_inconsistent(&m->p, why)) return refused(m, why);
    m->unchecked = 0;
    refresh(m);
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Model *m;
    UNUSED(name), UNUSED(type), UNUSED(resources), UNUSED(visible), UNUSED(logging);
    if (!guid || strcmp(guid, GUID)) return NULL;
    m = (Model *)malloc(sizeof *m);
    if (m) set_defaults(m, functions);
    return m;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    if (computed((Model *)c) != fmi2OK) return fmi2Error;
    ((Model *)c)->started = 1;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    set_defaults((Model *)c, ((Model *)c)->functions);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Model *m = (Model *)c;
    size_t i;
    for (i = 0; i < n; ++i) {
        const size_t k = vr[i];
        const int given = k < FIRST_OUTPUT || (k >= LONGEST_STEP && k < FIRST_STATE);
        if (!given && computed(m) != fmi2OK) return fmi2Error;
        if (k < FIRST_OUTPUT) value[i] = m->guessed[k] ? m->input0[k] : m->input[k];
        else if (k < LONGEST_STEP) value[i] = m->y[k - FIRST_OUTPUT];
        else if (k == LONGEST_STEP) value[i] = m->longest;
        else if (k < FIRST_STATE) value[i] = ((const double *)&m->p)[k - FIRST_NUMBER];
        else if (k < FIRST_RATE) value[i] = m->end[k - FIRST_STATE];
        else if (k < FIRST_RATE + STATES) value[i] = m->rate[k - FIRST_RATE];
        else return fmi2Error;
        /* solvers of model exchange try states without outputs */
        if (!given && k < LONGEST_STEP && m->h > 0.0 && !is_number(value[i]))
            return lost(m, model_output_names[k - FIRST_OUTPUT]);
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Model *m = (Model *)c;
    char why[TEXT];
    size_t i;
    m->known = 0;
    for (i = 0; i < n; ++i) {
        const size_t k = vr[i];
        if (k < FIRST_OUTPUT) {
            m->input[k] = value[i];
            m->guessed[k] = m->given[k] = 0;
            if (k >= PAIRS && value[i] != 0.0) m->rated[k - PAIRS] = 1;
        } else if (k == LONGEST_STEP) {
            const double before = m->longest;
            if (!(value[i] >= SHORTEST && is_number(value[i]))) {
                snprintf(why, TEXT, "longest_step must be finite and at least %g s, but is %g.", SHORTEST, value[i]);
                return refused(m, why);
            }
            m->longest = value[i];
            if (m->h > 0.0 && !steps_in(m, m->carry, m->h)) {
                m->longest = before;
                return refused(m, "With this longest step samples cannot lie between two steps of the model.");
            }
        } else if (k >= FIRST_NUMBER && k < FIRST_STATE) {
            double *number = (double *)&m->p + (k - FIRST_NUMBER);
            if (is_outside(k - FIRST_NUMBER, value[i], why)) return refused(m, why);
            if (*number != value[i]) m->unchecked = 1;
            if (m->h <= 0.0 && *number != value[i]) m->changed = 1;
            *number = value[i];
        } else {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

#ifdef PERIOD
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
                                        const fmi2ValueReference known[], size_t count, const fmi2Real change[],
                                        fmi2Real value[]) {
    UNUSED(unknown), UNUSED(n), UNUSED(known), UNUSED(count), UNUSED(change), UNUSED(value);
    return refused((Model *)c, "A controller jumps at its samples and has no derivatives; export the passive vehicle.");
}
#else
/* Changes of the outputs and of the rates of the states, for model exchange: in co-simulation the states at the end of
 * a step depend on the inputs. */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
                                        const fmi2ValueReference known[], size_t count, const fmi2Real change[],
                                        fmi2Real value[]) {
    Model *m = (Model *)c;
    double d[INPUTS], dx[STATES + 1], drate[STATES + 1], dy[OUTPUTS];
    model_parameters dp;
    size_t i;
    if (m->h > 0.0) return fmi2Error;
    memset(&dp, 0, sizeof dp);
    memset(d, 0, sizeof d);
    memset(dx, 0, sizeof dx);
    for (i = 0; i < count; ++i) {
        const size_t k = known[i];
        if (k < FIRST_OUTPUT) d[k] += change[i];
        else if (k >= FIRST_NUMBER && k < FIRST_STATE) ((double *)&dp)[k - FIRST_NUMBER] += change[i];
        else if (k >= FIRST_STATE && k < FIRST_RATE) dx[k - FIRST_STATE] += change[i];
        else return fmi2Error;
    }
    if (computed(m) != fmi2OK) return fmi2Error;
    observe_derivative(&m->p, &dp, m->end, dx, m->used, d, drate, dy);
    for (i = 0; i < n; ++i) {
        const size_t k = unknown[i];
        if (k >= FIRST_OUTPUT && k < LONGEST_STEP) value[i] = dy[k - FIRST_OUTPUT];
        else if (k >= FIRST_RATE && k < FIRST_RATE + STATES) value[i] = drate[k - FIRST_RATE];
        else return fmi2Error;
    }
    return fmi2OK;
}

/* ---- model exchange */

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    if (n != STATES || computed((Model *)c) != fmi2OK) return fmi2Error;
    if (n) memcpy(((Model *)c)->carry, x, n * sizeof *x);
    ((Model *)c)->known = 0;
    return fmi2OK;
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    if (n != STATES || computed((Model *)c) != fmi2OK) return fmi2Error;
    if (n) memcpy(x, ((const Model *)c)->end, n * sizeof *x);
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real rates[], size_t n) {
    Model *m = (Model *)c;
    if (n != STATES || computed(m) != fmi2OK) return fmi2Error;
    if (n) memcpy(rates, m->rate, n * sizeof *rates);
    return fmi2OK;
}

#endif

/* The largest values of the states in a cycle of the inputs by 40 mm within half a second: tolerances of solvers are
 * relative to them, and deflections of oil or of a series spring are below a millimetre. */
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominal[], size_t n) {
    Model *m = (Model *)c;
    double carry[CARRY + 1], u0[INPUTS], u1[INPUTS];
    size_t i;
    int step, steps, k;
    if (n != STATES || computed(m) != fmi2OK) return fmi2Error;
    steps = (int)ceil(0.5 / m->step);
    memcpy(carry, m->end, sizeof carry);
    memcpy(u1, m->input, sizeof u1);
    for (i = 0; i < n; ++i) nominal[i] = 0.0;
    for (step = 1; step <= steps; ++step) {
        const double rate = 4.0 * 3.14159265358979, phase = rate * step * m->step;
        memcpy(u0, u1, sizeof u0);
        for (k = 0; k < PAIRS; ++k) u1[k] = m->input[k] + 0.02 * (1.0 - cos(phase));
        for (k = 0; k < RATES; ++k) u1[PAIRS + k] = 0.02 * rate * sin(phase);
        advance(&m->p, &m->p, m->matrices, u0, u1, m->step, 1, carry);
        for (i = 0; i < n; ++i) nominal[i] = fmax(nominal[i], fabs(carry[i]));
    }
    for (i = 0; i < n; ++i)
        if (!(nominal[i] > 1e-12 && nominal[i] < HUGE_VAL)) nominal[i] = 1.0; /* nothing but rounding */
    return fmi2OK;
}

/* ---- co-simulation */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    Model *m = (Model *)c;
    size_t i;
    for (i = 0; i < n; ++i) {
        if (order[i] != 1) return fmi2Error;
        if (vr[i] < FIRST_OUTPUT) {
            m->slope[vr[i]] = value[i];
            m->given[vr[i]] = 1;
        } else if (vr[i] >= FIRST_NUMBER && vr[i] < FIRST_STATE) {
            m->number_slope[vr[i] - FIRST_NUMBER] = value[i];
        }
    }
    return fmi2OK;
}

/* The numbers of the step that begins, and those at its end as far as they are known. */
static void use_numbers(Model *m, double h) {
    double *now = (double *)&m->p, *before = (double *)&m->before;
    size_t k;
    for (k = 0; k < NUMBERS; ++k) {
        const double rise = h * m->number_slope[k], begin = now[k] + (NUMBERS_MOVE ? 0.0 : 0.5 * rise);
        if (before[k] != begin) m->changed = 1;
        before[k] = begin;
        now[k] += rise;
        m->number_slope[k] = 0.0;
    }
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean final) {
    Model *m = (Model *)c;
    int k;
    UNUSED(time), UNUSED(final);
    if (!(h > 0.0)) return fmi2Error;
    for (k = 0; k < INPUTS; ++k) {
        if (m->guessed[k]) m->input[k] = m->input0[k]; /* an input that was not set again keeps its value */
        m->known = m->known && !m->guessed[k];
    }
    if (computed(m) != fmi2OK) return fmi2Error;
    for (k = 0; k < OUTPUTS; ++k)
        if (!is_number(m->y[k])) return lost(m, model_output_names[k]);
    for (k = 0; k < CARRY; ++k)
        if (!is_number(m->end[k])) return lost(m, "A state");
    if (!steps_in(m, m->end, h))
        return refused(m, "The communication step cannot be divided so that samples and their commands lie between two "
                          "steps of the model: take the controller's period, a part or a multiple of it.");
    memcpy(m->carry, m->end, sizeof m->carry);
    use_numbers(m, h);
    for (k = RATES; k < PAIRS; ++k) {
        m->input0[k] = m->input[k];
        if (m->given[k]) m->input[k] += h * m->slope[k];
    }
    for (k = 0; k < RATES; ++k) {
        const int rate = PAIRS + k;
        const double now = m->input[k], v = m->input[rate];
        const double slope = m->h > 0.0 ? (now - m->input0[k]) / m->h : 0.0;
        const double bend = m->given[rate] ? m->slope[rate] : m->h > 0.0 ? (v - m->input0[rate]) / m->h : 0.0;
        m->input[rate] = v + h * bend;
        m->input[k] = now + h * (m->given[k] ? m->slope[k] : m->rated[k] ? 0.5 * (v + m->input[rate]) : slope);
        m->input0[k] = now;
        m->input0[rate] = v;
        m->slope_before[k] = slope;
    }
    for (k = 0; k < INPUTS; ++k) {
        m->guessed[k] = 1;
        m->given[k] = 0;
    }
    m->h = h;
    m->steps = m->steps < 2 ? m->steps + 1 : 2;
    m->known = 0;
    return fmi2OK;
}
