/* Macros of the generated text for LANES samples at once: REAL is a vector of doubles (GNU C). */
#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX2__)
#define LANES 4
#else
#define LANES 2
#endif
typedef double lanes_real __attribute__((vector_size(8 * LANES)));
typedef long long lanes_bits __attribute__((vector_size(8 * LANES)));
#undef REAL
#define REAL lanes_real
#undef COLUMNS
#undef ROW
#undef ENTRY
#undef STORE
#define COLUMNS 1
#define ROW REAL
#define ENTRY(row, j) (row)
#define STORE(to, row) (*(to) = (row))

/* A function of C for each lane; not inline where it is a call for each. */
#define EACH_LANE(kind, name) \
    static kind REAL name##_each(REAL x) \
    { \
        REAL r; \
        for (int l = 0; l < LANES; ++l) r[l] = name(x[l]); \
        return r; \
    }
#define EACH_LANE_2(kind, name) \
    static kind REAL name##_each(REAL x, REAL y) \
    { \
        REAL r; \
        for (int l = 0; l < LANES; ++l) r[l] = name(x[l], y[l]); \
        return r; \
    }
#define CALLED __attribute__((noinline, unused))
EACH_LANE(inline, sqrt)
EACH_LANE(inline, floor)
EACH_LANE(inline, ceil)
EACH_LANE(CALLED, tan)
EACH_LANE(CALLED, asin)
EACH_LANE(CALLED, acos)
EACH_LANE(CALLED, atan)
EACH_LANE(CALLED, sinh)
EACH_LANE(CALLED, cosh)
EACH_LANE(CALLED, asinh)
EACH_LANE(CALLED, acosh)
EACH_LANE(CALLED, atanh)
EACH_LANE(CALLED, exp)
EACH_LANE(CALLED, log)
EACH_LANE(CALLED, expm1)
EACH_LANE(CALLED, log1p)
EACH_LANE(CALLED, erf)
EACH_LANE_2(CALLED, pow)
EACH_LANE_2(CALLED, hypot)
EACH_LANE_2(CALLED, fmod)
#undef MATH
#define MATH(name) name##_each

/* Functions of glibc's vector library, within 4 units in the last place. */
#if LANES == 8
#define VECTOR_FUNCTION(name) _ZGVeN8v_##name
#define VECTOR_FUNCTION_2(name) _ZGVeN8vv_##name
#elif LANES == 4
#define VECTOR_FUNCTION(name) _ZGVdN4v_##name
#define VECTOR_FUNCTION_2(name) _ZGVdN4vv_##name
#else
#define VECTOR_FUNCTION(name) _ZGVbN2v_##name
#define VECTOR_FUNCTION_2(name) _ZGVbN2vv_##name
#endif
#if defined(NO_MVEC)
EACH_LANE(CALLED, sin)
EACH_LANE(CALLED, cos)
#else
REAL VECTOR_FUNCTION(sin)(REAL), VECTOR_FUNCTION(cos)(REAL);
#define sin_each VECTOR_FUNCTION(sin)
#define cos_each VECTOR_FUNCTION(cos)
#if defined(__GLIBC_PREREQ)
#if __GLIBC_PREREQ(2, 35)
#define NEWER_MVEC
#endif
#endif
#endif
#if defined(NEWER_MVEC)
REAL VECTOR_FUNCTION(tanh)(REAL), VECTOR_FUNCTION_2(atan2)(REAL, REAL);
#define tanh_each VECTOR_FUNCTION(tanh)
#define atan2_each VECTOR_FUNCTION_2(atan2)
#else
EACH_LANE(CALLED, tanh)
EACH_LANE_2(CALLED, atan2)
#endif

#define ALL_LANES(x) ((x) - (REAL){0}) /* keeps the sign of -0.0 */
#define BITS(x) ((lanes_bits)(x))
#define SIGN_BIT ((lanes_bits){0} - 0x7fffffffffffffffLL - 1)
#define TRUE_WHERE(mask) ((REAL)((mask) & BITS(ALL_LANES(1.0))))
static inline REAL lanes_choose(lanes_bits mask, REAL x, REAL y)
{
    return (REAL)((mask & BITS(x)) | (~mask & BITS(y)));
}
static inline REAL lanes_copysign(REAL x, REAL y)
{
    return (REAL)((~SIGN_BIT & BITS(x)) | (SIGN_BIT & BITS(y)));
}
static inline REAL lanes_fmin(REAL x, REAL y) { return lanes_choose((x <= y) | (y != y), x, y); }
static inline REAL lanes_fmax(REAL x, REAL y) { return lanes_choose((x >= y) | (y != y), x, y); }
static inline int lanes_any(lanes_bits mask)
{
    long long any = 0;
    for (int l = 0; l < LANES; ++l) any |= mask[l];
    return any != 0;
}

#undef PART
#define PART(name) name##_part_lanes
#undef CONST
#define CONST(x) ALL_LANES((double)(x))
#undef FABS
#define FABS(x) ((REAL)(~SIGN_BIT & BITS(x)))
#undef COPYSIGN
#define COPYSIGN(x, y) lanes_copysign(x, y)
#undef FMIN
#define FMIN(x, y) lanes_fmin(x, y)
#undef FMAX
#define FMAX(x, y) lanes_fmax(x, y)
#undef SIGN
#define SIGN(x) SELECT(EQ(x, CONST(0)) , x, SELECT(NE(x, x), x, COPYSIGN(CONST(1), x)))
#undef LT
#define LT(x, y) TRUE_WHERE((x) < (y))
#undef LE
#define LE(x, y) TRUE_WHERE((x) <= (y))
#undef EQ
#define EQ(x, y) TRUE_WHERE((x) == (y))
#undef NE
#define NE(x, y) TRUE_WHERE((x) != (y))
#undef NOT
#define NOT(x) TRUE_WHERE((x) == (REAL){0})
#undef AND
#define AND(x, y) TRUE_WHERE(((x) != (REAL){0}) & ((y) != (REAL){0}))
#undef OR
#define OR(x, y) TRUE_WHERE(((x) != (REAL){0}) | ((y) != (REAL){0}))
#undef SELECT
#define SELECT(c, x, y) lanes_choose((c) != (REAL){0}, x, y)
#undef ANY
#define ANY(c) lanes_any((c) != (REAL){0})
