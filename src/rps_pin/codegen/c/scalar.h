/* Macros of the generated text for one sample: REAL is double, or float where SINGLE is defined. */
#if defined(__TINYC__)
/* tcc may run where no headers of C are. */
double sqrt(double), sin(double), cos(double), tan(double), asin(double), acos(double);
double atan(double), sinh(double), cosh(double), tanh(double), asinh(double), acosh(double);
double atanh(double), exp(double), log(double), expm1(double), log1p(double), erf(double);
double fabs(double), floor(double), ceil(double), pow(double, double), atan2(double, double);
double fmin(double, double), fmax(double, double), fmod(double, double), hypot(double, double);
double copysign(double, double);
#define INFINITY (1e308 * 10)
#define NAN (INFINITY - INFINITY)
#elif !defined(__CUDACC_RTC__)
#include <math.h>
#else
#define INFINITY __int_as_float(0x7f800000)
#define NAN __int_as_float(0x7fffffff)
#endif

#if defined(SINGLE)
#define REAL float
#define MATH(name) name##f
#else
#define REAL double
#define MATH(name) name
#endif

#if defined(__cplusplus)
#define RESTRICT __restrict__
#else
#define RESTRICT restrict
#endif
#if defined(__CUDACC__) || defined(__CUDACC_RTC__)
#define LOCAL __device__ static
#define NOINLINE __noinline__
#else
#define LOCAL static
#if defined(__GNUC__) && !defined(__TINYC__)
#define NOINLINE __attribute__((noinline))
#else
#define NOINLINE
#endif
#endif

/* COLUMNS numbers of one sample that are computed alike. */
#if defined(__GNUC__) && !defined(__TINYC__) && !defined(__CUDACC__) \
    && (defined(__SSE2__) || defined(__aarch64__))
#define COLUMNS 8
typedef REAL columns_row __attribute__((vector_size(8 * sizeof(REAL))));
typedef REAL columns_stored
    __attribute__((vector_size(8 * sizeof(REAL)), aligned(sizeof(REAL)), may_alias));
#define ROW columns_row
#define ENTRY(row, j) ((row)[j])
#define STORE(to, row) (*(columns_stored *)(to) = (row))
#else
#define COLUMNS 1
#define ROW REAL
#define ENTRY(row, j) (row)
#define STORE(to, row) (*(to) = (row))
#endif

/* Chunks of a function. */
#define PART(name) name##_part

#define CONST(x) ((REAL)(x))
/* A number that depends on the rounding error. */
#if defined(SINGLE)
#define PRECISE(in_double, in_single) CONST(in_single)
#else
#define PRECISE(in_double, in_single) CONST(in_double)
#endif
#define SQRT(x) MATH(sqrt)(x)
#define SIN(x) MATH(sin)(x)
#define COS(x) MATH(cos)(x)
#define TAN(x) MATH(tan)(x)
#define ASIN(x) MATH(asin)(x)
#define ACOS(x) MATH(acos)(x)
#define ATAN(x) MATH(atan)(x)
#define ATAN2(y, x) MATH(atan2)(y, x)
#define SINH(x) MATH(sinh)(x)
#define COSH(x) MATH(cosh)(x)
#define TANH(x) MATH(tanh)(x)
#define ASINH(x) MATH(asinh)(x)
#define ACOSH(x) MATH(acosh)(x)
#define ATANH(x) MATH(atanh)(x)
#define EXP(x) MATH(exp)(x)
#define LOG(x) MATH(log)(x)
#define EXPM1(x) MATH(expm1)(x)
#define LOG1P(x) MATH(log1p)(x)
#define ERF(x) MATH(erf)(x)
#define POW(x, y) MATH(pow)(x, y)
#define HYPOT(x, y) MATH(hypot)(x, y)
#define FMOD(x, y) MATH(fmod)(x, y)
#define FLOOR(x) MATH(floor)(x)
#define CEIL(x) MATH(ceil)(x)
#define FABS(x) MATH(fabs)(x)
#define COPYSIGN(x, y) MATH(copysign)(x, y)
#define FMIN(x, y) MATH(fmin)(x, y)
#define FMAX(x, y) MATH(fmax)(x, y)
#define SIGN(x) ((x) < 0 ? CONST(-1) : (x) > 0 ? CONST(1) : (x))
/* Truth is a REAL: 1 or 0. */
#define LT(x, y) CONST((x) < (y))
#define LE(x, y) CONST((x) <= (y))
#define EQ(x, y) CONST((x) == (y))
#define NE(x, y) CONST((x) != (y))
#define NOT(x) CONST((x) == 0)
#define AND(x, y) CONST((x) != 0 && (y) != 0)
#define OR(x, y) CONST((x) != 0 || (y) != 0)
#define SELECT(c, x, y) ((c) != 0 ? (x) : (y))
#define ANY(c) ((c) != 0)
#define FINITE(x) ((x) - (x) == 0)
