/* Breaks one system call of the beginning or the closing of a run: the library is loaded before that of C (LD_PRELOAD) and counts the
   calls of the thread that writes records, from the write of the run's last event on, or from that of its first to its second one.

     AT_CALL=N        the number of the call, from 1; 0 breaks none
     AT_CALL_ERROR=E  the call fails with this errno; without it, the program is killed behind the call, which was made
     AT_CALL2=M       the call with this number fails, too, as one that takes back what was done
     AT_CALL_FROM=1   all calls from N on fail: a disk that died stays dead. With ENOSPC those fail that ask for room or write
     AT_CALL_BEGIN=1  the calls of the beginning
     AT_CALL_START=F  the calls of the whole program on files below the folder F, from its start to the first event of its run
     AT_CALL_LOG=F    the names of all counted calls, one a line */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

static __thread int counts, is_writer; /* of this thread: 1 yes, -1 no, 0 not known yet */
static int calls, has_begun;

static int writes(void) {
    if (!is_writer) {
        char name[16] = "";
        prctl(PR_GET_NAME, name);
        is_writer = strcmp(name, "writer") == 0 ? 1 : -1;
    }
    return is_writer == 1;
}

/* Whether a start is broken, and this file is below its folder. */
static int is_of_start(int dir, const char *path) {
    const char *folder = getenv("AT_CALL_START");
    if (!folder || has_begun || !path) return 0;
    char link[40], found[1024] = "";
    if (path[0] != '/') {
        if (dir == AT_FDCWD) strcpy(link, "/proc/self/cwd");
        else snprintf(link, sizeof link, "/proc/self/fd/%d", dir);
        ssize_t length = syscall(SYS_readlinkat, AT_FDCWD, link, found, sizeof found - 300);
        if (length < 0) return 0;
        snprintf(found + length, sizeof found - length, "/%s", path);
    } else snprintf(found, sizeof found, "%s", path);
    return strstr(found, folder) != NULL;
}

static void to_log(int number, const char *call) {
    const char *log = getenv("AT_CALL_LOG");
    if (!log) return;
    char line[300];
    int length = snprintf(line, sizeof line, "%d %s\n", number, call);
    int fd = syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_APPEND, 0644);
    if (fd >= 0) {
        syscall(SYS_write, fd, line, length);
        syscall(SYS_close, fd);
    }
}

/* Whether a full disk can refuse a call. */
static int grows(const char *call) {
    const char *names[] = {"write", "mkdir", "rename", "fsync", "fdatasync", "syncfs", "new "};
    for (unsigned i = 0; i < sizeof names / sizeof *names; i++)
        if (strncmp(call, names[i], strlen(names[i])) == 0) return 1;
    return 0;
}

/* 0: make the call; 1: make it and be killed; else fail with this errno. */
static int chosen(const char *call, int dir, const char *path) {
    if (getenv("AT_CALL_START") ? !is_of_start(dir, path) : !writes() || !counts) return 0;
    int number = __atomic_add_fetch(&calls, 1, __ATOMIC_SEQ_CST);
    to_log(number, call);
    const char *at = getenv("AT_CALL"), *second = getenv("AT_CALL2"), *error = getenv("AT_CALL_ERROR");
    if (!at) return 0;
    int first = atoi(at);
    int is_from = getenv("AT_CALL_FROM") && number > first && (!error || atoi(error) != ENOSPC || grows(call));
    if (number != first && !is_from && !(second && atoi(second) == number)) return 0;
    if (!error) return 1;
    errno = atoi(error);
    return errno;
}

/* What the station says, and the pipes between its threads, are on no disk. */
static int is_on_disk(int fd) {
    struct stat found;
    return syscall(SYS_fstat, fd, &found) == 0 && S_ISREG(found.st_mode);
}

#define REAL(name) (__typeof__(&name))dlsym(RTLD_NEXT, #name)

#define BREAK(call, dir, path, made, failed)                                                                                   \
    int broken = chosen(call, dir, path);                                                                                      \
    if (broken > 1) return failed;                                                                                             \
    __auto_type result = made;                                                                                                 \
    if (broken == 1) raise(SIGKILL);                                                                                           \
    return result

ssize_t write(int fd, const void *bytes, size_t length) {
    const char *from = getenv("AT_CALL_BEGIN") ? "\"kind\":\"run_started\"" : "\"kind\":\"run_ended\"";
    if (writes() && memmem(bytes, length, "{\"seq\":", 7)) counts = memmem(bytes, length, from, strlen(from)) != NULL;
    if (writes() && memmem(bytes, length, "\"kind\":\"run_started\"", 20)) has_begun = 1;
    if (!is_on_disk(fd)) return (REAL(write))(fd, bytes, length);
    BREAK("write", fd, "", (REAL(write))(fd, bytes, length), -1);
}

#define OPEN(name)                                                                                                             \
    int name(const char *path, int flags, ...) {                                                                               \
        va_list more;                                                                                                          \
        va_start(more, flags);                                                                                                 \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0;                                                \
        va_end(more);                                                                                                          \
        char call[256];                                                                                                        \
        snprintf(call, sizeof call, "%s%s %s", flags & O_CREAT ? "new " : "", "open", path);                                                                          \
        BREAK(call, AT_FDCWD, path, (REAL(name))(path, flags, mode), -1);                                                                      \
    }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                                                                           \
    int name(int dir, const char *path, int flags, ...) {                                                                      \
        va_list more;                                                                                                          \
        va_start(more, flags);                                                                                                 \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0;                                                \
        va_end(more);                                                                                                          \
        char call[256];                                                                                                        \
        snprintf(call, sizeof call, "%s%s %s", flags & O_CREAT ? "new " : "", "openat", path);                                                                        \
        BREAK(call, dir, path, (REAL(name))(dir, path, flags, mode), -1);                                                                 \
    }
OPENAT(openat)
OPENAT(openat64)

ssize_t read(int fd, void *bytes, size_t length) {
    if (!is_on_disk(fd)) return (REAL(read))(fd, bytes, length);
    BREAK("read", fd, "", (REAL(read))(fd, bytes, length), -1);
}
int fsync(int fd) { BREAK("fsync", fd, "", (REAL(fsync))(fd), -1); }
int fdatasync(int fd) { BREAK("fdatasync", fd, "", (REAL(fdatasync))(fd), -1); }
int syncfs(int fd) { BREAK("syncfs", fd, "", (REAL(syncfs))(fd), -1); }
int flock(int fd, int how) { BREAK("flock", fd, "", (REAL(flock))(fd, how), -1); }
int ftruncate(int fd, off_t length) { BREAK("ftruncate", fd, "", (REAL(ftruncate))(fd, length), -1); }
int ftruncate64(int fd, off64_t length) { BREAK("ftruncate", fd, "", (REAL(ftruncate64))(fd, length), -1); }
int rename(const char *from, const char *to) { BREAK("rename", AT_FDCWD, from, (REAL(rename))(from, to), -1); }
int unlink(const char *path) { BREAK("unlink", AT_FDCWD, path, (REAL(unlink))(path), -1); }
int unlinkat(int dir, const char *path, int flags) { BREAK("unlinkat", dir, path, (REAL(unlinkat))(dir, path, flags), -1); }
int rmdir(const char *path) { BREAK("rmdir", AT_FDCWD, path, (REAL(rmdir))(path), -1); }
int mkdir(const char *path, mode_t mode) { BREAK("mkdir", AT_FDCWD, path, (REAL(mkdir))(path, mode), -1); }
DIR *opendir(const char *path) { BREAK("opendir", AT_FDCWD, path, (REAL(opendir))(path), NULL); }
int statx(int dir, const char *restrict path, int flags, unsigned mask, struct statx *restrict stat) {
    BREAK("statx", dir, path, (REAL(statx))(dir, path, flags, mask, stat), -1);
}
