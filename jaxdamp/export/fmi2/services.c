/* The calls of FMI 2.0 that compute nothing: saved states, types without variables, events that never happen. It stands
 * behind unit.c. */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    UNUSED(c), UNUSED(on), UNUSED(n), UNUSED(categories);
    return fmi2OK;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean to, fmi2Real tolerance, fmi2Real start, fmi2Boolean ends,
                               fmi2Real stop) {
    UNUSED(c), UNUSED(to), UNUSED(tolerance), UNUSED(start), UNUSED(ends), UNUSED(stop);
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    UNUSED(c);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    UNUSED(c);
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
    const fmi2CallbackFunctions *functions = ((Model *)c)->functions;
    memcpy(c, saved, sizeof(Model));
    ((Model *)c)->functions = functions; /* the state may be that of another process */
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

/* ---- model exchange: there are no events */

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

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t n) {
    UNUSED(c), UNUSED(indicators);
    return n ? fmi2Error : fmi2OK;
}

/* ---- co-simulation */

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
    UNUSED(c), UNUSED(vr), UNUSED(order), UNUSED(value);
    return n ? fmi2Error : fmi2OK;
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
