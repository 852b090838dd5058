/* What compiled kernels need besides themselves: memory, a look at arrays and at the processor.
   Comes after `arrays.h`, and a definition of SOURCES. */

#include <stdlib.h>
#include <string.h>
#if defined(__x86_64__)
#include <cpuid.h>
#endif
#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { FITS = 0, MISFIT = -1 };

static const void *array_class;

EXPORT void isc_set_array_class(const void *class) { array_class = class; }

/* Whether `a` is an array with elements of `kind` ('b' Boolean, 'i' signed, 'u' unsigned, 'f'
   floating-point) and `size` bytes, and with this number of dimensions. */
static int fits(const array *a, char kind, int64_t size, int dimensions, int contiguous)
{
    static const char kinds[] = "biuiuiuiuiuff";
    static const char sizes[] = {1, 1, 1, 2, 2, 4, 4, sizeof(long), sizeof(long), 8, 8, 4, 8};
    if (a->class != array_class)
        return 0;
    const element *e = a->elements;
    return a->dimensions == dimensions && e->number < (int)sizeof(sizes)
        && kinds[e->number] == kind && sizes[e->number] == size && e->byte_order != '>'
        && (a->flags & ALIGNED) && (!contiguous || (a->flags & CONTIGUOUS));
}

static int64_t count(const array *a)
{
    int64_t product = 1;
    for (int k = 0; k < a->dimensions; k++)
        product *= a->shape[k];
    return product;
}

/* Memory of arrays that a kernel makes for itself: what Numba's runtime calls a MemInfo. Its count
   of references is kept by the kernel, see `portable_code`. */
typedef struct {
    size_t references;
    void (*release)(void *, size_t, void *);
    void *release_argument, *data;
    size_t size;
    void *allocator;
} memory;

memory *NRT_MemInfo_alloc_aligned(size_t size, unsigned alignment)
{
    memory *block = malloc(sizeof(memory) + size + alignment);
    if (block) {
        uintptr_t start = (uintptr_t)(block + 1) + alignment - 1;
        *block = (memory){1, 0, 0, (void *)(start - start % alignment), size, 0};
    }
    return block;
}

void NRT_MemInfo_call_dtor(memory *block) { free(block); }

/* Strides of an array in row-major order in another shape; kernels reshape no others. */
int numba_attempt_nocopy_reshape(intptr_t axes, const intptr_t *shape, const intptr_t *strides,
                                 intptr_t new_axes, const intptr_t *new_shape,
                                 intptr_t *new_strides, intptr_t size, int column_major)
{
    (void)axes, (void)shape, (void)strides, (void)column_major;
    for (intptr_t k = new_axes - 1; k >= 0; size *= new_shape[k--])
        new_strides[k] = size;
    return 1;
}

/* Whether this processor has what the kernels of this library were compiled for: 0 for any, 2 and 3
   for x86-64-v2 and -v3. */
static int has_level(int level)
{
#if defined(__x86_64__)
    unsigned a, b, c, d, low, high;
    const unsigned v2 = bit_SSE3 | bit_SSSE3 | bit_CMPXCHG16B | bit_SSE41 | bit_SSE42 | bit_POPCNT;
    const unsigned v3 = bit_FMA | bit_MOVBE | bit_OSXSAVE | bit_AVX | bit_F16C;
    if (!__get_cpuid(1, &a, &b, &c, &d) || (c & v2) != v2)
        return level < 2;
    if (level < 3)
        return 1;
    if ((c & v3) != v3 || !__get_cpuid_count(7, 0, &a, &b, &c, &d))
        return 0;
    if ((b & (bit_AVX2 | bit_BMI | bit_BMI2)) != (bit_AVX2 | bit_BMI | bit_BMI2))
        return 0;
    if (!__get_cpuid(0x80000001, &a, &b, &c, &d) || !(c & bit_LZCNT))
        return 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0)); /* the system saves the wide registers */
    return (low & 6) == 6;
#else
    return level == 0;
#endif
}

/* Digest and names of the files that the kernels are written in, see `kernel_library`. */
EXPORT const char *isc_sources(void) { return SOURCES; }

EXPORT int isc_processor_fits(void) { return has_level(LEVEL); }
