template <class T> struct quadcosim_kind {
    static T of(double x) { return x > -9e18 && x < 9e18 ? (T)(long long)(x < 0.0 ? x - 0.5 : x + 0.5) : (T)0; }
    static bool has(double x, double stored) { return stored - x >= -0.5 && stored - x <= 0.5; }
};
template <class T> struct quadcosim_real {
    static T of(double x) { return (T)x; }
    static bool has(double, double) { return true; }
};
#ifndef QUADCOSIM_IN_DOUBLE
template <> struct quadcosim_kind<float> : quadcosim_real<float> {};
#endif
template <> struct quadcosim_kind<double> : quadcosim_real<double> {};
template <class T> struct quadcosim_kind<T &> : quadcosim_kind<T> {};
template <class T> struct quadcosim_one { enum { is = 1 }; };
template <class T> struct quadcosim_one<T *> { enum { is = 0 }; };
template <class T, unsigned long N> struct quadcosim_one<T[N]> { enum { is = 0 }; };
template <class T> struct quadcosim_one<T &> : quadcosim_one<T> {};
extern "C" void quadcosim_init(void);
extern "C" void quadcosim_after_parameters(void);
extern "C" void quadcosim_step(void);
extern "C" void quadcosim_run(unsigned);
extern "C" unsigned quadcosim_set_inputs(const double *, unsigned);
extern "C" unsigned quadcosim_set_parameters(const double *, unsigned);
extern "C" void quadcosim_get_outputs(double *, unsigned);
extern "C" void quadcosim_get_all(double *, unsigned);
extern "C" void __cxa_pure_virtual(void) { __builtin_trap(); } /* the runtime library's would take more of it */
