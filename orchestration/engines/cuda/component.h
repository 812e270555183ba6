/* The end of a component's namespace: its step, 0 or the number of the error by which it fails. The general step is a
   function apart, so that what it needs of registers is no matter of the straight line. */

static __noinline__ int general_step(q_place *v, q_real t, q_real h) {
    q_real failed = 0.0;
    return model_do_step(v, 1, &failed, t, h) ? 0 : (int)failed;
}

static __noinline__ int step(q_place *v, q_real t, q_real h) {
#ifdef STRAIGHT_STEP
    if (STRAIGHT_STEP(v, 1, t, h)) return 0;
#endif
    return general_step(v, t, h);
}

#undef STRAIGHT_STEP
