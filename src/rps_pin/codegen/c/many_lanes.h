/* Groups of LANES samples; the last group repeats its last sample. */
#if LANES == 8
#define EVERY_LANE(do) do(0) do(1) do(2) do(3) do(4) do(5) do(6) do(7)
#elif LANES == 4
#define EVERY_LANE(do) do(0) do(1) do(2) do(3)
#else
#define EVERY_LANE(do) do(0) do(1)
#endif
#define READ_LANE(l) from[l * stride + k],
#define WRITE_LANE(l) to[l * size + k] = from[k][l];

#if LANES > 2
/* LANES x LANES numbers are transposed in registers: single ones of rows 1 apart are exchanged, then
   pairs of rows 2 apart, then fours of rows 4 apart. */
#if defined(__clang__) || __GNUC__ >= 12
#define TAKE(x, y, ...) __builtin_shufflevector(x, y, __VA_ARGS__)
#else
#define TAKE(x, y, ...) __builtin_shuffle(x, y, (lanes_bits){__VA_ARGS__})
#endif
typedef REAL lanes_unaligned __attribute__((aligned(8)));

#if LANES == 8
#define SINGLES(a, b) x = a, a = TAKE(x, b, 0, 8, 2, 10, 4, 12, 6, 14), \
                      b = TAKE(x, b, 1, 9, 3, 11, 5, 13, 7, 15)
#define PAIRS(a, b) x = a, a = TAKE(x, b, 0, 1, 8, 9, 4, 5, 12, 13), \
                    b = TAKE(x, b, 2, 3, 10, 11, 6, 7, 14, 15)
#define FOURS(a, b) x = a, a = TAKE(x, b, 0, 1, 2, 3, 8, 9, 10, 11), \
                    b = TAKE(x, b, 4, 5, 6, 7, 12, 13, 14, 15)
#define ROWS(get) r0 = get(0), r1 = get(1), r2 = get(2), r3 = get(3), \
                  r4 = get(4), r5 = get(5), r6 = get(6), r7 = get(7)
#define TRANSPOSE() \
    SINGLES(r0, r1), SINGLES(r2, r3), SINGLES(r4, r5), SINGLES(r6, r7), \
    PAIRS(r0, r2), PAIRS(r1, r3), PAIRS(r4, r6), PAIRS(r5, r7), \
    FOURS(r0, r4), FOURS(r1, r5), FOURS(r2, r6), FOURS(r3, r7)
#else
#define SINGLES(a, b) x = a, a = TAKE(x, b, 0, 4, 2, 6), b = TAKE(x, b, 1, 5, 3, 7)
#define PAIRS(a, b) x = a, a = TAKE(x, b, 0, 1, 4, 5), b = TAKE(x, b, 2, 3, 6, 7)
#define ROWS(get) r0 = get(0), r1 = get(1), r2 = get(2), r3 = get(3)
#define TRANSPOSE() SINGLES(r0, r1), SINGLES(r2, r3), PAIRS(r0, r2), PAIRS(r1, r3)
#endif
#define READ_ROW(l) *(const lanes_unaligned *)(from + l * stride + at)
#define WRITE_ROW(l) *(lanes_unaligned *)(to + l * (long)size + at) = r##l;
#define OWN_ROW(l) from[at + l]
#define KEEP_ROW(l) to[at + l] = r##l;

/* Of sizes from LANES on; the last square overlaps the one before. */
static void many_gather_squares(REAL *to, const double *from, long stride, int size)
{
    for (int k = 0; k < size; k += LANES) {
        const int at = k + LANES <= size ? k : size - LANES;
        REAL x, ROWS(READ_ROW);
        TRANSPOSE();
        EVERY_LANE(KEEP_ROW)
    }
}

static void many_scatter_squares(double *to, const REAL *from, int size)
{
    for (int k = 0; k < size; k += LANES) {
        const int at = k + LANES <= size ? k : size - LANES;
        REAL x, ROWS(OWN_ROW);
        TRANSPOSE();
        EVERY_LANE(WRITE_ROW)
    }
}
#endif

static void many_gather(REAL *to, const double *from, long stride, int size, int count)
{
#if LANES > 2
    if (count == LANES && size >= LANES) {
        many_gather_squares(to, from, stride, size);
        return;
    }
#endif
    if (count == LANES)
        for (int k = 0; k < size; ++k) to[k] = (REAL){EVERY_LANE(READ_LANE)};
    else
        for (int l = 0; l < LANES; ++l)
            for (int k = 0; k < size; ++k)
                to[k][l] = from[(l < count ? l : count - 1) * stride + k];
}

static void many_scatter(double *to, const REAL *from, int size, int count)
{
#if LANES > 2
    if (count == LANES && size >= LANES) {
        many_scatter_squares(to, from, size);
        return;
    }
#endif
    if (count == LANES)
        for (int k = 0; k < size; ++k) { EVERY_LANE(WRITE_LANE) }
    else
        for (int l = 0; l < count; ++l)
            for (int k = 0; k < size; ++k) to[l * size + k] = from[k][l];
}

static lanes_bits many_not_finite(const REAL *x, int size)
{
    lanes_bits bad = {0};
    for (int k = 0; k < size; ++k) bad |= (x[k] - x[k]) != (REAL){0};
    return bad;
}

static void many_fetch(const double *from, long size)
{
    for (long k = 0; k < size; k += 8) __builtin_prefetch(from + k);
}

/* x and y have room for a group's inputs and outputs, the output `check` included. */
static void many_groups(const many_shape *f, long n, const double *const *in, const long *stride,
                        double *const *out, int *status, REAL *x, REAL *y,
                        void (*group)(const REAL *x, REAL *y))
{
    const int *in_size = f->sizes, *out_size = f->sizes + f->inputs;
    lanes_bits same_bad = {0}; /* of inputs that are the same for all samples */
    REAL *to = x;
    for (int i = 0; i < f->inputs; to += in_size[i++])
        if (stride[i] == 0) {
            many_gather(to, in[i], 0, in_size[i], 1);
            same_bad |= many_not_finite(to, in_size[i]);
        }
    for (long s = 0; s < n; s += LANES) {
        const int count = n - s < LANES ? (int)(n - s) : LANES;
        lanes_bits bits = same_bad, open, singular;
        if (count == 1) {
            const int found = many_one(f, s, in, stride, out);
            if (status) status[s] = found;
            continue;
        }
        to = x;
        for (int i = 0; i < f->inputs; to += in_size[i++])
            if (stride[i] != 0) {
                many_gather(to, in[i] + s * stride[i], stride[i], in_size[i], count);
                bits |= many_not_finite(to, in_size[i]);
            }
        if (n - s >= 2 * LANES) { /* what the next group reads and writes is fetched meanwhile */
            for (int i = 0; i < f->inputs; ++i)
                many_fetch(in[i] + (s + LANES) * stride[i], LANES * stride[i]);
            for (int j = 0; j < f->outputs; ++j)
                many_fetch(out[j] + (s + LANES) * out_size[j], LANES * out_size[j]);
        }
        group(x, y);
        const REAL *from = y;
        for (int j = 0; j < f->outputs; from += out_size[j++]) {
            many_scatter(out[j] + s * out_size[j], from, out_size[j], count);
            bits |= many_not_finite(from, out_size[j]);
        }
        if (!status) continue;
        bits &= 1;
        if (f->checked) {
            open = ~(from[0] <= CONST(1.0));
            singular = ~(from[1] <= CONST(f->limit));
            bits |= (open & 2) | (singular & 4);
        }
        for (int l = 0; l < count; ++l) status[s + l] = (int)bits[l];
    }
}
