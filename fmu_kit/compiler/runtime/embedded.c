/* $model, written by quadcosim export-c: see $model.h. */

#include "$model.h"

$includes
/* -- mathematics ------------------------------------------------------------------------------------------------- */

$mathematics
/* -- the model ---------------------------------------------------------------------------------------------------- */

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-variable" /* values that only a message would use */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

typedef $model q_model;

Q_ONE int q_fail(q_model *m, int status, int kind)
{
    m->status = status;
    return kind;
}

$functions
/* -- the interface ------------------------------------------------------------------------------------------------ */

static int refused_input(const q_model *m)
{
    (void)m;
$inputs    return 0;
}

void ${model}_init($model *c)
{
    *c = ($model){
$starts    };
}

int ${model}_start($model *c, $real t)
{
    if (c->status) return c->status;
    if (c->started) return c->status = $twice;
    if (!q_isfinite(t)) return c->status = $never;
    if ((c->status = refused_input(c))) return c->status;
    c->$start_time = t;
    c->started = $initialise(c) == 0;
    return c->status;
}

int ${model}_step($model *c, $real t, $real h)
{
    if (c->status) return c->status;
    if (!c->started) return c->status = $early;
    if ((c->status = refused_input(c))) return c->status;
    $do_step(c, t, h);
    return c->status;
}

$changed#ifdef ${guard}_NO_TEXTS

const char *${model}_error(int status)
{
    (void)status;
    return "";
}

#else

static const char *const texts[] = {
$texts};

const char *${model}_error(int status)
{
    return status >= 0 && status < (int)(sizeof texts / sizeof *texts) ? texts[status] : "no such status";
}

#endif
