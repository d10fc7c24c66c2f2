/* FMI 2.0, model exchange and co-simulation, of a damper law. It stands behind the functions of the law: law_parameters,
 * LAW_STATES, law_defaults, law_init, law_force, law_advance, law_state_rate and the derivatives of force and rate; GUID
 * is a text.
 *
 * Co-simulation has no delay of a step. A step ends at a stroke and a velocity that the importer knows only afterwards:
 * after fmi2DoStep they are extrapolated (or follow from fmi2SetRealInputDerivatives), and as soon as the inputs of the
 * new instant are set, the states are those of the step between the true inputs.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { STROKE, VELOCITY, FORCE, LONGEST_STEP, FIRST_NUMBER };
#define NUMBERS (sizeof(law_parameters) / sizeof(double))
#define FIRST_STATE (FIRST_NUMBER + NUMBERS)
#define FIRST_RATE (FIRST_STATE + LAW_STATES)
#define UNUSED(name) ((void)(name))

typedef struct {
    law_parameters p;
    double longest;              /* s, longest step of the law; longer communication steps are divided */
    double state[LAW_STATES + 1]; /* at the beginning of the step that ends now */
    double motion0[2], motion[2]; /* stroke and velocity at its beginning and its end */
    double slope[2];             /* their rates, given by the importer */
    int given[2];                /* whether the rates are known */
    int guessed[2];              /* whether the end is extrapolated */
    double h;                    /* its duration; zero before the first and for model exchange */
    int started;                 /* initialisation is over */
} Model;

static void set_defaults(Model *m) {
    memset(m, 0, sizeof *m);
    m->longest = 1e-3;
    law_defaults(&m->p);
    law_init(&m->p, m->state);
}

/* The states at the end of the step: the velocity is linear in time, the stroke the cubic with these velocities. */
static void end_state(const Model *m, double *state) {
    const double x0 = m->motion0[0], v0 = m->motion0[1], x1 = m->motion[0], v1 = m->motion[1], h = m->h;
    int n = (int)ceil(h / m->longest - 1e-9), i;
    double x = x0, v = v0;
    memcpy(state, m->state, sizeof m->state);
    if (h <= 0.0) return;
    if (n < 1) n = 1;
    for (i = 1; i <= n; ++i) {
        const double s = (double)i / n, r = 1.0 - s;
        const double rise = h * (v0 * s * r * r - v1 * s * s * r);
        const double next = i == n ? x1 : x0 * (1.0 + 2.0 * s) * r * r + x1 * s * s * (3.0 - 2.0 * s) + rise;
        const double faster = i == n ? v1 : v0 + s * (v1 - v0);
        law_advance(&m->p, x, v, next, faster, h / n, state);
        x = next;
        v = faster;
    }
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    UNUSED(c), UNUSED(on), UNUSED(n), UNUSED(categories);
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    Model *m;
    UNUSED(name), UNUSED(type), UNUSED(resources), UNUSED(functions), UNUSED(visible), UNUSED(logging);
    if (!guid || strcmp(guid, GUID)) return NULL;
    m = (Model *)malloc(sizeof *m);
    if (m) set_defaults(m);
    return m;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean to, fmi2Real tolerance, fmi2Real start, fmi2Boolean ends,
                               fmi2Real stop) {
    UNUSED(c), UNUSED(to), UNUSED(tolerance), UNUSED(start), UNUSED(ends), UNUSED(stop);
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    UNUSED(c);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    ((Model *)c)->started = 1;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    UNUSED(c);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    set_defaults((Model *)c);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    const Model *m = (const Model *)c;
    double state[LAW_STATES + 1], rate[LAW_STATES + 1];
    size_t i;
    end_state(m, state);
    law_state_rate(&m->p, m->motion[0], m->motion[1], state, rate);
    for (i = 0; i < n; ++i) {
        const size_t k = vr[i];
        if (k < FORCE) value[i] = m->guessed[k] ? m->motion0[k] : m->motion[k];
        else if (k == FORCE) value[i] = law_force(&m->p, m->motion[0], m->motion[1], state);
        else if (k == LONGEST_STEP) value[i] = m->longest;
        else if (k < FIRST_STATE) value[i] = ((const double *)&m->p)[k - FIRST_NUMBER];
        else if (k < FIRST_RATE) value[i] = state[k - FIRST_STATE];
        else if (k < FIRST_RATE + LAW_STATES) value[i] = rate[k - FIRST_RATE];
        else return fmi2Error;
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Model *m = (Model *)c;
    size_t i;
    for (i = 0; i < n; ++i) {
        const size_t k = vr[i];
        if (k < FORCE) {
            m->motion[k] = value[i];
            m->guessed[k] = m->given[k] = 0;
        } else if (k == LONGEST_STEP && value[i] > 0.0) {
            m->longest = value[i];
        } else if (k >= FIRST_NUMBER && k < FIRST_STATE) {
            ((double *)&m->p)[k - FIRST_NUMBER] = value[i];
            if (!m->started) law_init(&m->p, m->state);
        } else {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

/* There are numbers of one type only. */
#define NO_VARIABLES(Name, Type)                                                                                       \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, Type value[]) {                 \
        UNUSED(c), UNUSED(vr), UNUSED(value);                                                                          \
        return n ? fmi2Error : fmi2OK;                                                                                 \
    }                                                                                                                  \
    fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference vr[], size_t n, const Type value[]) {           \
        UNUSED(c), UNUSED(vr), UNUSED(value);                                                                          \
        return n ? fmi2Error : fmi2OK;                                                                                 \
    }
NO_VARIABLES(Integer, fmi2Integer)
NO_VARIABLES(Boolean, fmi2Boolean)
NO_VARIABLES(String, fmi2String)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *saved) {
    if (!*saved) *saved = malloc(sizeof(Model));
    if (!*saved) return fmi2Error;
    memcpy(*saved, c, sizeof(Model));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate saved) {
    memcpy(c, saved, sizeof(Model));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *saved) {
    UNUSED(c);
    free(*saved);
    *saved = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate saved, size_t *size) {
    UNUSED(c), UNUSED(saved);
    *size = sizeof(Model);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate saved, fmi2Byte bytes[], size_t size) {
    UNUSED(c);
    if (size < sizeof(Model)) return fmi2Error;
    memcpy(bytes, saved, sizeof(Model));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *saved) {
    UNUSED(c);
    if (size != sizeof(Model)) return fmi2Error;
    if (!*saved) *saved = malloc(sizeof(Model));
    if (!*saved) return fmi2Error;
    memcpy(*saved, bytes, sizeof(Model));
    return fmi2OK;
}

/* Changes of the force and of the rates of the states, for model exchange: in co-simulation the states at the end of a
 * step depend on the inputs. */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
                                        const fmi2ValueReference known[], size_t count, const fmi2Real change[],
                                        fmi2Real value[]) {
    const Model *m = (const Model *)c;
    const double x = m->motion[0], v = m->motion[1];
    double d[2] = {0.0, 0.0}, dstate[LAW_STATES + 1], drate[LAW_STATES + 1];
    law_parameters dp;
    size_t i;
    if (m->h > 0.0) return fmi2Error;
    memset(&dp, 0, sizeof dp);
    memset(dstate, 0, sizeof dstate);
    for (i = 0; i < count; ++i) {
        const size_t k = known[i];
        if (k < FORCE) d[k] += change[i];
        else if (k >= FIRST_NUMBER && k < FIRST_STATE) ((double *)&dp)[k - FIRST_NUMBER] += change[i];
        else if (k >= FIRST_STATE && k < FIRST_RATE) dstate[k - FIRST_STATE] += change[i];
        else return fmi2Error;
    }
    law_state_rate_derivative(&m->p, &dp, x, d[0], v, d[1], m->state, dstate, drate);
    for (i = 0; i < n; ++i) {
        const size_t k = unknown[i];
        if (k == FORCE) value[i] = law_force_derivative(&m->p, &dp, x, d[0], v, d[1], m->state, dstate);
        else if (k >= FIRST_RATE && k < FIRST_RATE + LAW_STATES) value[i] = drate[k - FIRST_RATE];
        else return fmi2Error;
    }
    return fmi2OK;
}

/* ---- model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    UNUSED(c);
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    UNUSED(c);
    memset(info, 0, sizeof *info);
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    UNUSED(c);
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean final, fmi2Boolean *event, fmi2Boolean *stop) {
    UNUSED(c), UNUSED(final);
    *event = *stop = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    UNUSED(c), UNUSED(time);
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    if (n != LAW_STATES) return fmi2Error;
    if (n) memcpy(((Model *)c)->state, x, n * sizeof *x);
    return fmi2OK;
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    if (n != LAW_STATES) return fmi2Error;
    if (n) memcpy(x, ((const Model *)c)->state, n * sizeof *x);
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real rates[], size_t n) {
    const Model *m = (const Model *)c;
    if (n != LAW_STATES) return fmi2Error;
    if (n) law_state_rate(&m->p, m->motion[0], m->motion[1], m->state, rates);
    return fmi2OK;
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t n) {
    UNUSED(c), UNUSED(indicators);
    return n ? fmi2Error : fmi2OK;
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominal[], size_t n) {
    size_t i;
    UNUSED(c);
    for (i = 0; i < n; ++i) nominal[i] = 1.0;
    return fmi2OK;
}

/* ---- co-simulation */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    Model *m = (Model *)c;
    size_t i;
    for (i = 0; i < n; ++i) {
        if (order[i] != 1) return fmi2Error;
        if (vr[i] >= FORCE) continue;
        m->slope[vr[i]] = value[i];
        m->given[vr[i]] = 1;
    }
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
    UNUSED(c), UNUSED(vr), UNUSED(order), UNUSED(value);
    return n ? fmi2Error : fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean final) {
    Model *m = (Model *)c;
    double state[LAW_STATES + 1], now[2], slope;
    int k;
    UNUSED(time), UNUSED(final);
    if (!(h > 0.0)) return fmi2Error;
    for (k = 0; k < 2; ++k) {
        if (m->guessed[k]) m->motion[k] = m->motion0[k]; /* an input that was not set again keeps its value */
        now[k] = m->motion[k];
    }
    end_state(m, state);
    memcpy(m->state, state, sizeof state);
    slope = m->given[1] ? m->slope[1] : m->h > 0.0 ? (now[1] - m->motion0[1]) / m->h : 0.0;
    m->motion[1] = now[1] + h * slope;
    m->motion[0] = now[0] + h * (m->given[0] ? m->slope[0] : 0.5 * (now[1] + m->motion[1]));
    for (k = 0; k < 2; ++k) {
        m->motion0[k] = now[k];
        m->guessed[k] = 1;
        m->given[k] = 0;
    }
    m->h = h;
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    UNUSED(c);
    return fmi2Error;
}

#define NO_STATUS(Name, Type)                                                                                          \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2StatusKind kind, Type *value) {                                \
        UNUSED(c), UNUSED(kind), UNUSED(value);                                                                        \
        return fmi2Discard;                                                                                            \
    }
NO_STATUS(Status, fmi2Status)
NO_STATUS(RealStatus, fmi2Real)
NO_STATUS(IntegerStatus, fmi2Integer)
NO_STATUS(BooleanStatus, fmi2Boolean)
NO_STATUS(StringStatus, fmi2String)
