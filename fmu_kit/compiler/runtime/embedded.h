/* $model$version: $description

   Written by $tool (export-c) from the slave in Python: change it there. $precision
   C99 without allocation, without an operating system. An instance is one struct; instances share nothing.

       static $model c;
       ${model}_init(&c);
       c.par.NAME = ...; c.in.NAME = ...;
       if (${model}_start(&c, t)) ...
       and every h seconds
           c.in.NAME = ...;
           if (${model}_step(&c, t, h)) ...
           ... = c.out.NAME;

   A status is 0, or what ${model}_error() has words for. After an error every call returns the same status, until
   init; the outputs stay as they were. Integers and truth values are real numbers too. */

#ifndef ${guard}_H
#define ${guard}_H

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
$groups
    int status;        /* of the last call */
    int started;       /* whether ${model}_start went well */
    unsigned warnings; /* bits of what the user should know, as far as it has come up */
} $model;

$warnings/* Begin anew, with the start values of all variables. */
void ${model}_init($model *c);

/* Check the parameters, and compute the outputs for the first inputs, at the time t [s]. */
int ${model}_start($model *c, $real t);

/* Advance from t to t + h [s] with the inputs held. */
int ${model}_step($model *c, $real t, $real h);

$changed/* What a status means, with "..." where a message of the FMU has a number. Where ${guard}_NO_TEXTS is defined there
   are no texts, and this is "" for all. */
const char *${model}_error(int status);

#ifdef __cplusplus
}
#endif

#endif
