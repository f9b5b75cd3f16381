/* Before scalar.h: the number of a thread, and how many there are; sine and cosine at once. */
#define FIRST_SAMPLE ((long long)blockIdx.x * blockDim.x + threadIdx.x)
#define SAMPLE_STEP ((long long)gridDim.x * blockDim.x)
#define SINCOS(x, sine, cosine) \
    REAL sine, cosine; \
    MATH(sincos)(x, &sine, &cosine)
