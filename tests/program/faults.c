/* Put between a program and its system (LD_PRELOAD): counts calls that write below the folder FAULT_DIR, and lets the one
 * with the number FAULT_AT fail. The count goes to the file FAULT_COUNT when the program ends. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static long count;

static int fails(const char *path) {
    const char *dir = getenv("FAULT_DIR"), *at = getenv("FAULT_AT");
    if (!dir || !at || !path || strncmp(path, dir, strlen(dir))) return 0;
    return __sync_add_and_fetch(&count, 1) == atol(at);
}

static int fd_fails(int fd) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, sizeof path - 1);
    if (n < 0) return 0;
    path[n] = 0;
    return fails(path);
}

static int path_fails(const char *path) {
    char whole[8192];
    if (path[0] != '/') {
        char here[4096];
        if (!getcwd(here, sizeof here)) return 0;
        snprintf(whole, sizeof whole, "%s/%s", here, path);
        return fails(whole);
    }
    return fails(path);
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
#define FAIL(code) do { errno = (code); return -1; } while (0)

ssize_t write(int fd, const void *bytes, size_t n) {
    if (fd > 2 && fd_fails(fd)) FAIL(ENOSPC);
    return REAL(write)(fd, bytes, n);
}

ssize_t writev(int fd, const struct iovec *parts, int n) {
    if (fd > 2 && fd_fails(fd)) FAIL(ENOSPC);
    return REAL(writev)(fd, parts, n);
}

int fsync(int fd) {
    if (fd_fails(fd)) FAIL(EIO);
    return REAL(fsync)(fd);
}

int fdatasync(int fd) {
    if (fd_fails(fd)) FAIL(EIO);
    return REAL(fdatasync)(fd);
}

int ftruncate64(int fd, off64_t n) {
    if (fd_fails(fd)) FAIL(EIO);
    return REAL(ftruncate64)(fd, n);
}

int rename(const char *from, const char *to) {
    if (path_fails(to)) FAIL(EIO);
    return REAL(rename)(from, to);
}

int linkat(int a, const char *from, int b, const char *to, int flags) {
    if (path_fails(to)) FAIL(EIO);
    return REAL(linkat)(a, from, b, to, flags);
}

__attribute__((destructor)) static void tell(void) {
    const char *name = getenv("FAULT_COUNT");
    if (!name) return;
    int fd = open(name, O_WRONLY | O_CREAT | O_TRUNC, 0644);
    char text[32];
    int n = snprintf(text, sizeof text, "%ld", count);
    if (fd >= 0) {
        ssize_t done = REAL(write)(fd, text, (size_t)n);
        (void)done;
        close(fd);
    }
}
