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

static void many_gather(REAL *to, const double *from, long stride, int size, int count)
{
    if (count == LANES)
        for (int k = 0; k < size; ++k) to[k] = (REAL){EVERY_LANE(READ_LANE)};
    else
        for (int l = 0; l < LANES; ++l)
            for (int k = 0; k < size; ++k)
                to[k][l] = from[(l < count ? l : count - 1) * stride + k];
}

static void many_scatter(double *to, const REAL *from, int size, int count)
{
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
