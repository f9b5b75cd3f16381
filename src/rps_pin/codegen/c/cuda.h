/* Before scalar.h: the number of a thread, and how many there are. */
#define FIRST_SAMPLE ((long long)blockIdx.x * blockDim.x + threadIdx.x)
#define SAMPLE_STEP ((long long)gridDim.x * blockDim.x)
