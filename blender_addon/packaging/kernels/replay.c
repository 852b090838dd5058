/* Calls a library of compiled kernels without Python: with the arguments in a file, on forged arrays
   of NumPy, and writes what came out to another. `replay.py` writes the list `callers` in front of
   this, and says how the files are laid out.

   replay LIBRARY CALLS OUTCOMES: exit code 0, or 1 after a line that says what is wrong. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if defined(_WIN32)
#include <windows.h>
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

static void *library;
static FILE *calls, *outcomes;

static void fail(const char *what, const char *which)
{
    fprintf(stderr, "%s %s\n", what, which);
    exit(1);
}

static void *find(const char *name)
{
    void *function = FIND(library, name);
    if (!function)
        fail("the library lacks", name);
    return function;
}

static void take(void *place, size_t size)
{
    if (size && fread(place, 1, size, calls) != size)
        fail("truncated:", "calls");
}

/* NumPy's number of a type of elements; which of two equal integers it takes depends on the system. */
static int number_of(char kind, int64_t size)
{
    const int wide = sizeof(long) == 8;
    if (kind == 'b')
        return 0;
    if (kind == 'f')
        return size == 4 ? 11 : 12;
    return size == 1 ? 1 : size == 4 ? (wide ? 5 : 7) : (wide ? 7 : 9);
}

static void take_value(value *v)
{
    record *r = &v->record;
    take(r, sizeof *r);
    if (r->kind == 0)
        return;
    v->memory = malloc((size_t)r->length + 1);
    take(v->memory, (size_t)r->length);
    v->elements = (element){1, 0, 0, (char)r->kind, 0, '=', 0, number_of((char)r->kind, r->size)};
    v->array = (array){1,          &library,   v->memory + r->offset, (int)r->axes, r->shape,
                       r->strides, 0,          &v->elements,          0};
    v->array.flags = ALIGNED | (r->contiguous ? CONTIGUOUS : 0);
}

static void replay_call(void)
{
    char name[NAME];
    int64_t head[2] = {0, 0}; /* number of values; then status and result */
    value values[MOST];
    take(name, sizeof name);
    take(head, sizeof head[0]);
    const int64_t taken = head[0];
    for (int64_t k = 0; k < taken; k++)
        take_value(&values[k]);
    size_t which = 0;
    while (which < sizeof callers / sizeof *callers && strcmp(callers[which].name, name))
        which++;
    if (which == sizeof callers / sizeof *callers)
        fail("no such kernel:", name);
    head[1] = 0;
    head[0] = callers[which].call(find(name), &head[1], values);
    fwrite(head, sizeof head, 1, outcomes);
    for (int64_t k = 0; k < taken; k++)
        if (values[k].record.kind) {
            fwrite(values[k].memory, 1, (size_t)values[k].record.length, outcomes);
            free(values[k].memory);
        }
}

int main(int count, char **arguments)
{
    int64_t number;
    if (count != 4)
        fail("usage:", "replay LIBRARY CALLS OUTCOMES");
    library = OPEN(arguments[1]);
    calls = fopen(arguments[2], "rb");
    outcomes = fopen(arguments[3], "wb");
    if (!library || !calls || !outcomes)
        fail("cannot open", arguments[!library ? 1 : !calls ? 2 : 3]);
    ((void (*)(const void *))find("isc_set_array_class"))(&library);
    if (!((int (*)(void))find("isc_processor_fits"))())
        fail("not for this processor:", arguments[1]);
    take(&number, sizeof number);
    while (number-- > 0)
        replay_call();
    return fclose(outcomes) ? 1 : 0;
}
