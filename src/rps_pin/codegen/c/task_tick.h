/* What a tick of a task needs besides the functions of its mechanism. */
static int holds(const double *check) { return check[0] <= 1.0 && check[1] <= 1.0; }

static int all_finite(const double *x, int size)
{
    int i;
    for (i = 0; i < size; ++i)
        if (!FINITE(x[i])) return 0;
    return 1;
}

static void normalise(double *x, int size)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < size; ++i) sum += x[i] * x[i];
    sum = sqrt(sum);
    for (i = 0; i < size; ++i) x[i] /= sum;
}

/* The sum of squares of numbers times their scales. */
static double squares(const double *x, const double *scale, int size)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < size; ++i) sum += (x[i] * scale[i]) * (x[i] * scale[i]);
    return sum;
}

/* The norm of a matrix times its scales less a reference. */
static double distance(const double *x, const double *scale, const double *reference, int size)
{
    double sum = 0.0, one;
    int i;
    for (i = 0; i < size; ++i) {
        one = x[i] * scale[i] - reference[i];
        sum += one * one;
    }
    return sqrt(sum);
}

/* Writes the inverse of a square matrix, which it destroys, and returns the determinant: by
   elimination with the largest pivot of a column. Entries are not finite where it is singular. */
static double inverted(double *matrix, double *inverse, int n)
{
    double determinant = 1.0, factor;
    int i, j, k, best;
    for (i = 0; i < n * n; ++i) inverse[i] = i % (n + 1) ? 0.0 : 1.0;
    for (k = 0; k < n; ++k) {
        best = k;
        for (i = k + 1; i < n; ++i)
            if (fabs(matrix[i * n + k]) > fabs(matrix[best * n + k])) best = i;
        if (best != k) {
            determinant = -determinant;
            for (j = 0; j < n; ++j) {
                factor = matrix[k * n + j];
                matrix[k * n + j] = matrix[best * n + j];
                matrix[best * n + j] = factor;
                factor = inverse[k * n + j];
                inverse[k * n + j] = inverse[best * n + j];
                inverse[best * n + j] = factor;
            }
        }
        determinant *= matrix[k * n + k];
        factor = 1.0 / matrix[k * n + k];
        for (j = 0; j < n; ++j) {
            matrix[k * n + j] *= factor;
            inverse[k * n + j] *= factor;
        }
        for (i = 0; i < n; ++i) {
            if (i == k) continue;
            factor = matrix[i * n + k];
            for (j = 0; j < n; ++j) {
                matrix[i * n + j] -= factor * matrix[k * n + j];
                inverse[i * n + j] -= factor * inverse[k * n + j];
            }
        }
    }
    return determinant;
}
