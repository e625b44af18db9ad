/* fmi2.c: the functions of FMI 2.0 for co-simulation, on top of fmu.h. https://fmi-standard.org has the standard. */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmu.h"
#include "fmi/standard/fmi2Functions.h"

typedef struct {
    fmu_t *fmu;
    char *name;
    fmi2CallbackFunctions callback;
    double start_time;
} component_t;

/* A message has no "%", so it is passed as the format: some simulators show only the format. */
static fmi2Status fail(const component_t *component, const char *message)
{
    if (component->callback.logger != NULL)
        component->callback.logger(component->callback.componentEnvironment, component->name, fmi2Error,
                                   "logStatusError", message);
    return fmi2Error;
}

static fmi2Status result(const component_t *component, bool done)
{
    return done ? fmi2OK : fail(component, fmu_message(component->fmu));
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

/* Errors are always logged, and there is nothing else to log. */
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    (void)c;
    (void)loggingOn;
    (void)nCategories;
    (void)categories;
    return fmi2OK;
}

static component_t *new_component(fmi2String name, const fmi2CallbackFunctions *functions)
{
    component_t *component = calloc(1, sizeof *component);
    if (component == NULL)
        return NULL;
    component->callback = *functions;
    component->fmu = fmu_new();
    component->name = malloc(strlen(name) + 1);
    if (component->fmu == NULL || component->name == NULL) {
        fmi2FreeInstance(component);
        return NULL;
    }
    strcpy(component->name, name);
    return component;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    (void)fmuResourceLocation;
    (void)visible;
    (void)loggingOn;
    if (functions == NULL)
        return NULL;
    component_t *component = new_component(instanceName != NULL ? instanceName : "", functions);
    if (component == NULL)
        return NULL;
    const char *refusal = NULL;
    if (fmuType != fmi2CoSimulation)
        refusal = "this FMU is for co-simulation alone";
    else if (fmuGUID == NULL || strcmp(fmuGUID, fmu_robot.token) != 0)
        refusal = "the GUID is that of another modelDescription.xml";
    if (refusal == NULL)
        return component;
    (void)fail(component, refusal);
    fmi2FreeInstance(component);
    return NULL;
}

void fmi2FreeInstance(fmi2Component c)
{
    component_t *component = c;
    if (component == NULL)
        return;
    fmu_free(component->fmu);
    free(component->name);
    free(component);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    (void)toleranceDefined;
    (void)tolerance;
    (void)stopTimeDefined;
    (void)stopTime;
    ((component_t *)c)->start_time = startTime;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    component_t *component = c;
    return result(component, fmu_begin(component->fmu, component->start_time));
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    (void)c;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    fmu_reset(((component_t *)c)->fmu);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    component_t *component = c;
    for (size_t i = 0; i < nvr; i++)
        if (!fmu_get(component->fmu, vr[i], false, &value[i]))
            return result(component, false);
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    component_t *component = c;
    for (size_t i = 0; i < nvr; i++)
        if (!fmu_set(component->fmu, vr[i], false, value[i]))
            return result(component, false);
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
{
    component_t *component = c;
    for (size_t i = 0; i < nvr; i++) {
        double number;
        if (!fmu_get(component->fmu, vr[i], true, &number))
            return result(component, false);
        value[i] = number != 0 ? fmi2True : fmi2False;
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
{
    component_t *component = c;
    for (size_t i = 0; i < nvr; i++)
        if (!fmu_set(component->fmu, vr[i], true, value[i] != fmi2False))
            return result(component, false);
    return fmi2OK;
}

static fmi2Status no_variables(fmi2Component c, size_t count)
{
    return count == 0 ? fmi2OK : fail(c, "there are variables of the types Real and Boolean alone");
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    (void)vr;
    (void)value;
    return no_variables(c, nvr);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    (void)vr;
    (void)value;
    return no_variables(c, nvr);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    (void)vr;
    (void)value;
    return no_variables(c, nvr);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    (void)vr;
    (void)value;
    return no_variables(c, nvr);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    const component_t *component = c;
    if (*FMUstate == NULL)
        *FMUstate = malloc(fmu_size());
    if (*FMUstate == NULL)
        return fail(component, "out of memory");
    fmu_save(component->fmu, *FMUstate);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    if (FMUstate == NULL)
        return fail(c, "there is no state to go back to");
    fmu_restore(((component_t *)c)->fmu, FMUstate);
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    (void)c;
    if (FMUstate != NULL) {
        free(*FMUstate);
        *FMUstate = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    component_t *component = c;
    (void)noSetFMUStatePriorToCurrentPoint;
    return result(component, fmu_step(component->fmu, currentCommunicationPoint, communicationStepSize));
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    size_t time = 0;
    while (time < fmu_robot.variable_count && fmu_robot.variable[time].kind != FMU_TIME)
        time++;
    component_t *component = c;
    return s == fmi2LastSuccessfulTime ? result(component, fmu_get(component->fmu, time, false, value)) : fmi2Discard;
}
