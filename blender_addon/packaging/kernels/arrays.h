/* Arrays of NumPy, without its headers.

   The first fields of an array are part of NumPy's binary interface, the same in versions 1 and 2.
   Limits: 64-bit, little-endian, not for free-threaded Python, whose objects begin with other
   fields. */

#include <stdint.h>

/* PyArray_Descr and PyArrayObject_fields, up to the last field that is read. */
typedef struct {
    intptr_t references;
    void *class;
    void *scalar;
    char kind, type, byte_order, flags;
    int number;
} element;
typedef struct {
    intptr_t references;
    void *class;
    char *data;
    int dimensions;
    intptr_t *shape, *strides;
    void *base;
    element *elements;
    int flags;
} array;

enum { CONTIGUOUS = 0x1, ALIGNED = 0x100 };
