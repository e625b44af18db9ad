/* fmi3.c: the functions of FMI 3.0 for co-simulation, on top of fmu.h. https://fmi-standard.org has the standard. */
#include <stdlib.h>
#include <string.h>

#include "fmi/fmu.h"
#include "fmi/standard/fmi3Functions.h"

typedef struct {
    fmu_t *fmu;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    double start_time;
} instance_t;

static fmi3Status fail(const instance_t *instance, const char *message)
{
    if (instance->log != NULL)
        instance->log(instance->environment, fmi3Error, "logStatusError", message);
    return fmi3Error;
}

static fmi3Status result(const instance_t *instance, bool done)
{
    return done ? fmi3OK : fail(instance, fmu_message(instance->fmu));
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

/* Errors are always logged, and there is nothing else to log. */
fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[])
{
    (void)instance;
    (void)loggingOn;
    (void)nCategories;
    (void)categories;
    return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                         fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                         fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[],
                                         size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate)
{
    (void)instanceName;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables;
    (void)intermediateUpdate;
    const instance_t asked = {.environment = instanceEnvironment, .log = logMessage};
    const char *refusal = NULL;
    if (instantiationToken == NULL || strcmp(instantiationToken, fmu_robot.token) != 0)
        refusal = "the instantiation token is that of another modelDescription.xml";
    else if (eventModeUsed || nRequiredIntermediateVariables > 0)
        refusal = "this FMU has no event mode and no intermediate updates";
    if (refusal != NULL) {
        (void)fail(&asked, refusal);
        return NULL;
    }
    instance_t *instance = malloc(sizeof *instance);
    if (instance == NULL)
        return NULL;
    *instance = asked;
    instance->fmu = fmu_new();
    if (instance->fmu != NULL)
        return instance;
    free(instance);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    if (instance != NULL)
        fmu_free(((instance_t *)instance)->fmu);
    free(instance);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    (void)toleranceDefined;
    (void)tolerance;
    (void)stopTimeDefined;
    (void)stopTime;
    ((instance_t *)instance)->start_time = startTime;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    instance_t *own = instance;
    return result(own, fmu_begin(own->fmu, own->start_time));
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    fmu_reset(((instance_t *)instance)->fmu);
    return fmi3OK;
}

static bool as_many(const instance_t *instance, size_t references, size_t values)
{
    if (references == values)
        return true;
    (void)fail(instance, "every variable is a scalar, so that there are as many values as value references");
    return false;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float64 values[], size_t nValues)
{
    instance_t *own = instance;
    if (!as_many(own, nValueReferences, nValues))
        return fmi3Error;
    for (size_t i = 0; i < nValues; i++)
        if (!fmu_get(own->fmu, valueReferences[i], false, &values[i]))
            return result(own, false);
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues)
{
    instance_t *own = instance;
    if (!as_many(own, nValueReferences, nValues))
        return fmi3Error;
    for (size_t i = 0; i < nValues; i++)
        if (!fmu_set(own->fmu, valueReferences[i], false, values[i]))
            return result(own, false);
    return fmi3OK;
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Boolean values[], size_t nValues)
{
    instance_t *own = instance;
    if (!as_many(own, nValueReferences, nValues))
        return fmi3Error;
    for (size_t i = 0; i < nValues; i++) {
        double number;
        if (!fmu_get(own->fmu, valueReferences[i], true, &number))
            return result(own, false);
        values[i] = number != 0;
    }
    return fmi3OK;
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Boolean values[], size_t nValues)
{
    instance_t *own = instance;
    if (!as_many(own, nValueReferences, nValues))
        return fmi3Error;
    for (size_t i = 0; i < nValues; i++)
        if (!fmu_set(own->fmu, valueReferences[i], true, values[i]))
            return result(own, false);
    return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    const instance_t *own = instance;
    if (*FMUState == NULL)
        *FMUState = malloc(fmu_size());
    if (*FMUState == NULL)
        return fail(own, "out of memory");
    fmu_save(own->fmu, *FMUState);
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    if (FMUState == NULL)
        return fail(instance, "there is no state to go back to");
    fmu_restore(((instance_t *)instance)->fmu, FMUState);
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    (void)instance;
    if (FMUState != NULL) {
        free(*FMUState);
        *FMUState = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                      fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    instance_t *own = instance;
    (void)noSetFMUStatePriorToCurrentPoint;
    *eventHandlingNeeded = fmi3False;
    *terminateSimulation = fmi3False;
    *earlyReturn = fmi3False;
    *lastSuccessfulTime = currentCommunicationPoint;
    if (!fmu_step(own->fmu, currentCommunicationPoint, communicationStepSize))
        return result(own, false);
    *lastSuccessfulTime += communicationStepSize;
    return fmi3OK;
}
