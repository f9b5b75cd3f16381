/* Calls from Python: float64 arrays of NumPy in, new arrays out, without a header of either. */
#define MOST_ARGUMENTS 64

/* How NumPy's PyArray_Descr and PyArrayObject begin, and PyMethodDef with what stands behind it
   here; python_calls.py has the same, and proves the first two. */
typedef struct {
    long references;
    void *type, *scalar;
    char kind, letter, order, old_flags;
    int number;
} py_dtype;
typedef struct {
    long references;
    void *type;
    char *data;
    int nd;
    const long *dimensions, *strides;
    void *base;
    const py_dtype *dtype;
    int flags;
} py_array;
typedef struct {
    const char *name;
    void *code;
    int flags;
    const char *doc;
    long inputs, outputs;
    const long *shapes; /* of each input and output: how many dimensions, then each */
    void *array_type;
    void *(*new_array)(void *type, int nd, const long *dimensions, int number, const long *strides,
                       void *data, int size, int flags, void *like);
    void *(*new_tuple)(long size);
    int (*set)(void *tuple, long at, void *value);
    void *(*integer)(long value);
    void *(*call)(void *callable, void *const *arguments, unsigned long count, void *names);
    void (*drop)(void *value);
    void *(*release)(void); /* of Python's lock, or NULL */
    void (*acquire)(void *thread);
} py_method;

#define PY_DOUBLE 12
#define PY_IN_ORDER 0x101 /* contiguous as in C, and aligned */

/* Whether x is exactly a float64 array of this machine's byte order, of one shape, contiguous. */
static int py_fits(const py_array *x, const long *shape, const void *array_type)
{
    if (x->type != array_type || x->nd != shape[0] || (x->flags & PY_IN_ORDER) != PY_IN_ORDER ||
        x->dtype->number != PY_DOUBLE || x->dtype->order != '=')
        return 0;
    for (int k = 0; k < x->nd; ++k)
        if (x->dimensions[k] != shape[1 + k]) return 0;
    return 1;
}

/* A builtin function of Python, of the kind METH_FASTCALL | METH_KEYWORDS: the outputs and the
   status of one sample. `self` is an array whose memory is a py_method; it is called for all other
   arguments. */
static void *py_call(void *self, void *const *arguments, long count, void *names,
                     int (*at)(double *const *io))
{
    const py_method *f = (const py_method *)((const py_array *)self)->data;
    const long *shape = f->shapes;
    double *io[MOST_ARGUMENTS];
    void *made[MOST_ARGUMENTS + 1], *thread = 0, *result;
    long n = 0;
    if (names || count != f->inputs) return f->call(self, arguments, count, names);
    for (long i = 0; i < count; ++i, shape += 1 + shape[0]) {
        const py_array *x = arguments[i];
        if (!py_fits(x, shape, f->array_type)) return f->call(self, arguments, count, names);
        io[i] = (double *)x->data;
    }
    for (; n < f->outputs; ++n, shape += 1 + shape[0]) {
        const int nd = (int)shape[0];
        made[n] = f->new_array(f->array_type, nd, shape + 1, PY_DOUBLE, 0, 0, 0, 0, 0);
        if (!made[n]) goto failed;
        io[count + n] = (double *)((const py_array *)made[n])->data;
    }
    if (f->release) thread = f->release();
    const int status = at(io);
    if (f->release) f->acquire(thread);
    made[n] = f->integer(status);
    if (!made[n]) goto failed;
    ++n;
    result = f->new_tuple(n);
    if (!result) goto failed;
    for (long j = 0; j < n; ++j) f->set(result, j, made[j]);
    return result;
failed: /* Python knows the error */
    while (n) f->drop(made[--n]);
    return 0;
}
