/* A power that compilers know. */

#include "mathematics.h"

double square(double x) { return q_pow(x, 2.0); }
