// Makes the n-th open, write, fsync or rename that touches files under a folder fail; see faults.py.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static atomic_int seen = 0;  // files are flushed in several threads

static int fails(const char* call, const char* path) {
    const char* wanted = getenv("FAULT_CALL");
    const char* under = getenv("FAULT_UNDER");
    if (!wanted || !under || !path || strcmp(wanted, call) != 0 || strncmp(path, under, strlen(under)) != 0) {
        return 0;
    }
    if (++seen != atoi(getenv("FAULT_NUMBER"))) {
        return 0;
    }
    int (*real_open)(const char*, int, ...) = (int (*)(const char*, int, ...))dlsym(RTLD_NEXT, "open");
    close(real_open(getenv("FAULT_MARK"), O_WRONLY | O_CREAT, 0600));
    errno = atoi(getenv("FAULT_ERRNO"));
    return 1;
}

static int descriptor_fails(const char* call, int descriptor) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) {
        return 0;
    }
    path[length] = 0;
    return fails(call, path);
}

static int open_with(const char* name, const char* path, int flags, int mode) {
    if ((flags & O_CREAT) && fails("open", path)) {
        return -1;
    }
    int (*real)(const char*, int, ...) = (int (*)(const char*, int, ...))dlsym(RTLD_NEXT, name);
    return real(path, flags, mode);
}

int open(const char* path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    int mode = va_arg(rest, int);
    va_end(rest);
    return open_with("open", path, flags, mode);
}

int open64(const char* path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    int mode = va_arg(rest, int);
    va_end(rest);
    return open_with("open64", path, flags, mode);
}

ssize_t write(int descriptor, const void* data, size_t size) {
    ssize_t (*real)(int, const void*, size_t) = (ssize_t (*)(int, const void*, size_t))dlsym(RTLD_NEXT, "write");
    return descriptor_fails("write", descriptor) ? -1 : real(descriptor, data, size);
}

int fsync(int descriptor) {
    int (*real)(int) = (int (*)(int))dlsym(RTLD_NEXT, "fsync");
    return descriptor_fails("fsync", descriptor) ? -1 : real(descriptor);
}

int rename(const char* from, const char* to) {
    int (*real)(const char*, const char*) = (int (*)(const char*, const char*))dlsym(RTLD_NEXT, "rename");
    return fails("rename", to) ? -1 : real(from, to);
}

int renameat(int from_folder, const char* from, int to_folder, const char* to) {
    int (*real)(int, const char*, int, const char*) =
        (int (*)(int, const char*, int, const char*))dlsym(RTLD_NEXT, "renameat");
    return fails("rename", to) ? -1 : real(from_folder, from, to_folder, to);
}
