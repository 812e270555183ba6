/* The end of a component's namespace: its step, which returns 0 or the number of its error. The general step is a
   separate function, so that its registers do not add to those of the straight line. If it changes a number that is a
   constant in the line, the run fails here, and another engine repeats it. */

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
