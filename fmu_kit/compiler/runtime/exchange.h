/* Model exchange: the functions of FMI 2.0 and FMI 3.0 by which a solver of the host moves the continuous states.

   The file of a version of FMI includes this one near its end. */

#define IN_EXCHANGE(name, condition) \
    if (!m->exchanges || !(condition)) \
        return refuse_with(m, NAME(name) ": not allowed in this mode", "", "")
#define IN_CONTINUOUS_TIME(name) \
    IN_EXCHANGE(name, m->state.phase == STEPPING && m->state.mode == CONTINUOUS_MODE)

/* An array with the value of each state. */
#define OF_STATES(name, n) \
    IN_EXCHANGE(name, m->state.phase == INITIALIZATION || m->state.phase == STEPPING); \
    if (n != STATES) \
        return refuse_with(m, NAME(name) ": expected as many values as there are states", "", "")

/* A host whose step is too long may try a shorter one. */
static Status discard(Instance *m)
{
    log_message(m, DISCARD, LOG_ERROR, "time and states: expected finite values");
    return DISCARD;
}

/* What changes at events is as it is from now on. */
static Status update_at_event(Instance *m, double *next, int *has_next)
{
    int error;
    m->state.since = m->state.time;
    if ((error = find_rates(m)))
        return refuse(m, error);
    *next = m->rates[RATES - 1];
    *has_next = *next > m->state.since;
    return OK;
}

static Status get_of_states(Instance *m, double *values, size_t n, int are_rates)
{
    const unsigned any = FIRST_RATE;
    int error = bring_up_to_date(m, &any, 1);
    if (!error && are_rates && m->state.phase == INITIALIZATION)
        error = find_rates(m);
    if (error)
        return refuse(m, error);
    for (size_t i = 0; i < n; i++)
        values[i] = are_rates ? m->rates[state_rates[i]] : m->state.memory[state_places[i]];
    return OK;
}

CALL(SetTime, double t)
{
    INSTANCE;
    IN_EXCHANGE(SetTime, m->state.phase == STEPPING);
    if (!q_isfinite(t))
        return discard(m);
    m->state.time = t;
    m->state.tick = TICKS;
    return OK;
}

CALL(SetContinuousStates, const double *x, size_t n)
{
    INSTANCE;
    IN_CONTINUOUS_TIME(SetContinuousStates);
    OF_STATES(SetContinuousStates, n);
    for (size_t i = 0; i < n; i++)
        if (!q_isfinite(x[i]))
            return discard(m);
    for (size_t i = 0; i < n; i++)
        m->state.memory[state_places[i]] = x[i];
    m->state.tick = TICKS;
    return OK;
}

CALL(GetContinuousStates, double *x, size_t n)
{
    INSTANCE;
    OF_STATES(GetContinuousStates, n);
    return get_of_states(m, x, n, 0);
}

CALL(GetNominalsOfContinuousStates, double *values, size_t n)
{
    INSTANCE;
    OF_STATES(GetNominalsOfContinuousStates, n);
    for (size_t i = 0; i < n; i++)
        values[i] = nominals[i];
    return OK;
}

CALL(GetEventIndicators, double *z, size_t n)
{
    INSTANCE;
    (void)z;
    IN_EXCHANGE(GetEventIndicators, n == 0);
    return OK;
}

PLAIN(EnterContinuousTimeMode)
{
    INSTANCE;
    IN_EXCHANGE(EnterContinuousTimeMode, m->state.phase == STEPPING && m->state.mode == EVENT_MODE);
    m->state.mode = CONTINUOUS_MODE;
    return OK;
}
