/* The end of a component's namespace: its step, 0 or else the number of the error by which it fails. The general step
   is a function apart, so that what it needs of registers is no matter of the straight line. If it changes what the
   line takes as known, the run is left to others. */

static __noinline__ int general_step(q_place *v, q_real t, q_real h) {
    q_real failed = 0.0;
    if (!model_do_step(v, 1, &failed, t, h)) return (int)failed;
    return as_known(v) ? 0 : -1;
}

static __noinline__ int step(q_place *v, q_real t, q_real h) {
#ifdef STRAIGHT_STEP
    if (STRAIGHT_STEP(v, 1, NULL, t, h)) return 0;
#endif
    return general_step(v, t, h);
}

#undef STRAIGHT_STEP
