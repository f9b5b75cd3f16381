/* The status of one sample: 1 not finite, 2 open, 4 nearly singular. */
LOCAL int status_not_finite(const REAL *x, int size)
{
    int bad = 0;
    for (int k = 0; k < size; ++k) bad |= !FINITE(x[k]);
    return bad;
}
#define STATUS_OF_CHECK(check, limit) \
    (((check)[0] <= 1 ? 0 : 2) | ((check)[1] <= (limit) ? 0 : 4))
