"""An FMU in C that looks for a file on its computer, in every place that a process can see."""

from support.foreign import ANY_STEP, build_lag

# Bits of what it says that it has found.
PLACES = {
    "open": 1, "environment": 2, "arguments": 4, "descriptors": 8, "working directory": 16,
    "other processes": 32, "own memory": 64, "walk": 128,
}  # fmt: skip

BEFORE = r"""
#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
extern char **environ;
static int has(const char *data, long n) { return n > 0 && memmem(data, n, "MARK" "ED_NAME", 11) != NULL; }
static int in_file(const char *path) {
    static char data[1 << 16]; FILE *f = fopen(path, "rb"); if (!f) return 0;
    long n = fread(data, 1, sizeof data, f); fclose(f); return has(data, n);
}
static int in_links(const char *folder) {
    DIR *d = opendir(folder); struct dirent *e; int found = 0; char path[4500], to[4096];
    if (!d) return 0;
    while ((e = readdir(d))) { snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        long n = readlink(path, to, sizeof to); if (has(to, n)) found = 1; }
    closedir(d); return found;
}
static int walk(const char *folder, int depth) {
    DIR *d = opendir(folder); struct dirent *e; int found = 0; char path[4500]; struct stat s;
    if (!d) return 0;
    while (!found && (e = readdir(d))) {
        if (e->d_name[0] == '.') continue;
        snprintf(path, sizeof path, "%s/%s", strcmp(folder, "/") ? folder : "", e->d_name);
        if (has(e->d_name, strlen(e->d_name))) found = 1;
        else if (depth && lstat(path, &s) == 0 && S_ISDIR(s.st_mode)) found = walk(path, depth - 1);
    }
    closedir(d); return found;
}
static int in_memory(void) {
    FILE *maps = fopen("/proc/self/maps", "r"); int mem = open("/proc/self/mem", 0), found = 0; char line[5000];
    if (!maps || mem < 0) return 0;
    char *block = malloc(1 << 20), mark[16]; strcpy(mark, "MARK"); strcat(mark, "ED_NAME");
    while (fgets(line, sizeof line, maps)) {
        unsigned long a, b; char r; if (sscanf(line, "%lx-%lx %c", &a, &b, &r) != 3 || r != 'r') continue;
        if (strstr(line, "lag") || strstr(line, "stack")) continue;   /* its own constants */
        for (unsigned long at = a; at < b; at += 1 << 20) {
            long n = b - at < 1 << 20 ? b - at : 1 << 20;
            if (at <= (unsigned long)block && (unsigned long)block < at + n) continue;
            n = pread(mem, block, n, at);
            if (n > 0 && memmem(block, n, mark, 11)) found = 1;
        }
        memset(block, 0, 1 << 20);
    }
    free(block); fclose(maps); close(mem); return found;
}
static int spy(void) {
    char path[300]; int found = 0; DIR *d; struct dirent *e;
    FILE *f = fopen("TARGET", "r"); if (f) { found |= 1; fclose(f); }
    for (char **v = environ; *v; v++) if (has(*v, strlen(*v))) found |= 2;
    if (in_file("/proc/self/environ")) found |= 2;
    if (in_file("/proc/self/cmdline")) found |= 4;
    if (in_links("/proc/self/fd")) found |= 8;
    if (walk(".", 2) || walk("..", 1)) found |= 16;
    long parent = getppid();
    if ((d = opendir("/proc"))) while ((e = readdir(d))) {
        long pid = atol(e->d_name); if (pid <= 0 || pid == getpid()) continue;
        snprintf(path, sizeof path, "/proc/%ld/cmdline", pid); if (in_file(path)) found |= 32;
        snprintf(path, sizeof path, "/proc/%ld/environ", pid); if (in_file(path)) found |= 32;
        snprintf(path, sizeof path, "/proc/%ld/fd", pid); if (in_links(path)) found |= 32;
    }
    if (d) closedir(d);
    if (parent > 1) for (long pid = parent; pid > parent - 40 && pid > 1; pid--) {
        snprintf(path, sizeof path, "/proc/%ld/cmdline", pid); if (in_file(path)) found |= 32;
    }
    if (in_memory()) found |= 64;
    if (walk("/tmp", 6) || walk("/home", 3) || walk("/root", 3)) found |= 128;
    return found;
}
"""


def build_spy(folder, target, name="spy"):
    """Path of an FMU whose output is a sum of ``PLACES`` in which it has found a file.

    Args:
        folder: where to work.
        target: the file, whose name has a part ``MARKED_NAME`` of 11 characters.
        name: of the FMU.
    """
    before = BEFORE.replace("TARGET", str(target))
    return build_lag(
        folder, name, "if (!m->steps) m->y = spy(); m->steps++; return 0;", ANY_STEP, before
    )


def found(value):
    """The places in which it has found the file."""
    return [name for name, bit in PLACES.items() if int(value) & bit]
