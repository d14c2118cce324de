/* Checks what a program finds whose system starts no more threads: a status, and a library that it can use with fewer. And
 * that refused calls leave the number of threads open.
 *
 * Takes no arguments; says what is wrong and returns 1. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "prpf.h"

/* Threads that the system still starts. */
static int left;

/* Takes the place of the system's function, also for the shared library. */
int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *), void *argument) {
    int (*create)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    void *symbol = dlsym(RTLD_NEXT, "pthread_create");
    if (left-- <= 0)
        return EAGAIN;
    memcpy(&create, &symbol, sizeof create);
    return create(thread, attributes, start, argument);
}

static void check(int is_right, const char *what) {
    if (!is_right) {
        const char *message = prpf_error_message();
        fprintf(stderr, "threads: %s; the library says: %s\n", what, message ? message : "nothing");
        exit(1);
    }
}

int main(void) {
    static const char *const NAMES[] = {"R", "G", "B"};
    static const float VALUES[] = {0.5f, 0.5f, 0.5f};
    PrpfStore *store;
    PrpfFilter *filter;

    left = 1000;
    check(prpf_store_create(8, 8, NAMES, 2, 0, 0, &store) == PRPF_STATUS_INVALID_ARGUMENT, "a store without blue");
    check(prpf_filter_create("median", &filter) == PRPF_STATUS_INVALID_ARGUMENT, "a filter that does not exist");
    left = 0;
    check(prpf_store_create(8, 8, NAMES, 3, 0, 0, &store) == PRPF_STATUS_OUT_OF_MEMORY && !store,
          "a store without threads");
    left = 2;
    check(prpf_set_threads(3) == PRPF_STATUS_OUT_OF_MEMORY, "three threads of two");
    check(prpf_error_message() && strstr(prpf_error_message(), "cannot start threads"), "the message");
    left = 1000;
    check(prpf_set_threads(2) == PRPF_STATUS_OK, "another number of threads");
    check(prpf_store_create(8, 8, NAMES, 3, 0, 0, &store) == PRPF_STATUS_OK, "a store");
    check(prpf_store_push(store, 0, 0, 1, 1, 1, VALUES, 3) == PRPF_STATUS_OK, "a sample");
    left = 0;
    check(prpf_filter_create("nlm", &filter) == PRPF_STATUS_OUT_OF_MEMORY && !filter, "a filter without threads");
    left = 1000;
    check(prpf_filter_create("nlm", &filter) == PRPF_STATUS_OK, "a filter");
    check(prpf_filter_run(filter, store) == PRPF_STATUS_OK, "a pass");
    prpf_filter_free(filter);
    prpf_store_free(store);
    return 0;
}
