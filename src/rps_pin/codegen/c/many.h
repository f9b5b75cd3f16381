/* Samples one by one, and in groups of LANES where there are lanes. */
#define MOST_ARGUMENTS 64
typedef struct {
    int inputs, outputs; /* without the output `check` */
    const int *sizes;    /* of the inputs, then of the outputs */
    int checked;         /* 1 if the output `check` comes last */
    double limit;        /* of growth */
    int (*at)(double *const *io);
} many_shape;

static int many_one(const many_shape *f, long s, const double *const *in, const long *stride,
                    double *const *out)
{
    double *io[MOST_ARGUMENTS];
    for (int i = 0; i < f->inputs; ++i) io[i] = (double *)(in[i] + s * stride[i]);
    for (int j = 0; j < f->outputs; ++j)
        io[f->inputs + j] = out[j] + s * f->sizes[f->inputs + j];
    return f->at(io);
}

static void many_scalar(const many_shape *f, long n, const double *const *in, const long *stride,
                        double *const *out, int *status)
{
    for (long s = 0; s < n; ++s) {
        const int found = many_one(f, s, in, stride, out);
        if (status) status[s] = found;
    }
}
