// Fails, cuts short or kills at a chosen call of the process that it is preloaded into
// (LD_PRELOAD), as inject_faults.py asks:
//
//   FAIL_CALLS   kinds of calls that are counted together, e.g. write+sync+rename
//   FAIL_AT      number of the one that fails, from 1; without it, calls are only counted
//   FAIL_HOW     once, always (from there on), half (of the bytes), kill, torn (half of the
//                bytes, then kill), killall or tornall (the parent, too)
//   FAIL_ERRNO   errno of the failure
//   FAIL_LEVEL   generation of processes that counts: 0 for the one that is started, 1 (default)
//                for what it forks, where `sidestep` does its work. exec() begins at 0.
//   FAIL_SPARES  a function of the program that is fragile, too: offset and size, in hexadecimal
//   FAIL_COUNTS  file of 64-bit counts: of FAIL_CALLS, of each kind, of those left alone
//
// Allocations on behalf of what ends the process without memory, whatever the program does, are
// left alone (kFragile).

#include <dirent.h>
#include <dlfcn.h>
#include <execinfo.h>
#include <fcntl.h>
#include <link.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}

namespace {

enum Kind {
  kAlloc,
  kLarge,
  kOpen,
  kRead,
  kWrite,
  kSync,
  kRename,
  kMap,
  kThread,
  kSocket,
  kClock,
  kFork,
  kKinds
};
constexpr const char* kNames[kKinds] = {"alloc",  "large", "open",   "read",   "write", "sync",
                                        "rename", "map",   "thread", "socket", "clock", "fork"};

enum class How { kOnce, kAlways, kHalf, kKill, kTorn };
enum class Fate { kPass, kFail, kHalf, kTorn };

struct Counts {
  std::atomic<std::uint64_t> chosen;
  std::atomic<std::uint64_t> of[kKinds];
  std::atomic<std::uint64_t> left_alone;
};

constexpr time_t kSetBack_s = 3600;
constexpr std::size_t kLarge_bytes = 4096;

/// Code, by library or by function, that crashes or gives up where an allocation fails: the dynamic
/// loader, glibc's registration of destructors of thread_local, libstdc++'s directory_iterator,
/// which is noexcept inside, Fontconfig, which uses what it was not given, and Cairo, which asserts
/// that it was given it. Pictures are drawn once the results and the summary are saved.
constexpr const char* kFragile[] = {
    "/ld-linux",           "/libfontconfig.",      "/libcairo.",
    "__cxa_thread_atexit", "18directory_iterator", "28recursive_directory_iterator"};

int (*main_of_program)(int, char**, char**) = nullptr;
Counts own_counts;
Counts* counts = &own_counts;
bool is_chosen[kKinds];
std::uint64_t fails_at = 0;
How how = How::kOnce;
bool kills_parent = false;
int failure = EIO;
int level_that_counts = 1;
std::uintptr_t program_begin = 0, spared_from = 0, spared_until = 0;
int level = -1;  // before main()

bool has_word(const char* list, const char* word) {
  const std::size_t length = std::strlen(word);
  for (const char* at = std::strstr(list, word); at != nullptr; at = std::strstr(at + 1, word)) {
    const bool begins = at == list || at[-1] == '+';
    if (begins && (at[length] == '\0' || at[length] == '+')) return true;
  }
  return false;
}

int find_program(dl_phdr_info* info, std::size_t, void*) {
  program_begin = info->dlpi_addr;
  return 1;  // The program is the first.
}

/// Whether what is fragile is among the callers.
bool is_fragile() {
  void* callers[64];
  const int count = backtrace(callers, 64);
  for (int i = 0; i < count; ++i) {
    Dl_info info{};
    if (dladdr(callers[i], &info) == 0) continue;
    const auto offset = reinterpret_cast<std::uintptr_t>(callers[i]) - program_begin;
    if (offset >= spared_from && offset < spared_until) return true;
    for (const char* const fragile : kFragile) {
      if (info.dli_fname != nullptr && std::strstr(info.dli_fname, fragile) != nullptr) return true;
      if (info.dli_sname != nullptr && std::strstr(info.dli_sname, fragile) != nullptr) return true;
    }
  }
  return false;
}

[[noreturn]] void die() {
  if (kills_parent) kill(getppid(), SIGKILL);
  kill(getpid(), SIGKILL);
  for (;;) pause();
}

/// Counts a call, and says what is to become of it.
Fate meet(Kind kind) {
  if (level != level_that_counts) return Fate::kPass;
  counts->of[kind].fetch_add(1, std::memory_order_relaxed);
  if (!is_chosen[kind]) return Fate::kPass;
  const std::uint64_t number = counts->chosen.fetch_add(1, std::memory_order_relaxed) + 1;
  const bool is_due = fails_at > 0 && (how == How::kAlways || kind == kClock ? number >= fails_at
                                                                             : number == fails_at);
  if (!is_due) return Fate::kPass;
  if (kind == kAlloc || kind == kLarge) {
    [[gnu::tls_model("initial-exec")]] static thread_local bool is_asking = false;
    if (is_asking) return Fate::kPass;
    is_asking = true;
    const bool is_left_alone = is_fragile();
    is_asking = false;
    if (is_left_alone) {
      counts->left_alone.fetch_add(1, std::memory_order_relaxed);
      return Fate::kPass;
    }
  }
  switch (how) {
    case How::kHalf: return Fate::kHalf;
    case How::kTorn: return Fate::kTorn;
    case How::kKill: die();
    default: errno = failure; return Fate::kFail;
  }
}

/// Of a call that cannot be done by half.
bool fails(Kind kind) {
  const Fate fate = meet(kind);
  if (fate == Fate::kTorn) die();
  return fate == Fate::kFail;
}

/// Whether an allocation fails. Where memory is short, small ones still find room that was freed:
/// only those of kLarge fail from some time on.
bool fails_to_give(std::size_t bytes) {
  const bool fails_as_large = bytes >= kLarge_bytes && fails(kLarge);
  return fails(kAlloc) || fails_as_large;
}

__attribute__((constructor)) void begin() {
  const char* text = std::getenv("FAIL_CALLS");
  for (int k = 0; k < kKinds; ++k) is_chosen[k] = text != nullptr && has_word(text, kNames[k]);
  if ((text = std::getenv("FAIL_AT")) != nullptr) fails_at = std::strtoull(text, nullptr, 10);
  if ((text = std::getenv("FAIL_ERRNO")) != nullptr) failure = std::atoi(text);
  if ((text = std::getenv("FAIL_LEVEL")) != nullptr) level_that_counts = std::atoi(text);
  if ((text = std::getenv("FAIL_HOW")) != nullptr) {
    kills_parent = std::strstr(text, "all") != nullptr;
    if (std::strcmp(text, "always") == 0) how = How::kAlways;
    if (std::strcmp(text, "half") == 0) how = How::kHalf;
    if (std::strncmp(text, "kill", 4) == 0) how = How::kKill;
    if (std::strncmp(text, "torn", 4) == 0) how = How::kTorn;
  }
  if ((text = std::getenv("FAIL_SPARES")) != nullptr) {
    char* rest = nullptr;
    spared_from = std::strtoull(text, &rest, 16);
    spared_until = spared_from + std::strtoull(rest, nullptr, 16);
  }
  dl_iterate_phdr(&find_program, nullptr);
  void* caller = nullptr;
  backtrace(&caller, 1);  // Loads what it needs.
  if ((text = std::getenv("FAIL_COUNTS")) != nullptr) {
    const int file = open(text, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (file >= 0 && ftruncate(file, sizeof(Counts)) == 0) {
      void* const memory =
          mmap(nullptr, sizeof(Counts), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
      if (memory != MAP_FAILED) counts = static_cast<Counts*>(memory);
    }
    if (file >= 0) close(file);
  }
}

bool is_console(const FILE* stream) { return stream == stdout || stream == stderr; }
bool is_console(int file) { return file == STDOUT_FILENO || file == STDERR_FILENO; }

/// What a call that moves bytes returns; `move(bytes)` does it.
template <class Move>
ssize_t moved(Kind kind, std::size_t bytes, Move move) {
  switch (meet(kind)) {
    case Fate::kFail: return -1;
    case Fate::kHalf: return move(bytes > 1 ? bytes / 2 : bytes);
    case Fate::kTorn: (void)move(bytes / 2); die();
    default: return move(bytes);
  }
}

}  // namespace

/// The next definition of a function: the C library's.
#define NEXT(name) \
  static const auto next = reinterpret_cast<decltype(&::name)>(dlsym(RTLD_NEXT, #name))

extern "C" {

void* malloc(std::size_t bytes) { return fails_to_give(bytes) ? nullptr : __libc_malloc(bytes); }
void* calloc(std::size_t count, std::size_t bytes) {
  return fails_to_give(count * bytes) ? nullptr : __libc_calloc(count, bytes);
}
void* realloc(void* memory, std::size_t bytes) {
  return fails_to_give(bytes) ? nullptr : __libc_realloc(memory, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  return fails_to_give(bytes) ? nullptr : __libc_memalign(alignment, bytes);
}
void* memalign(std::size_t alignment, std::size_t bytes) {
  return fails_to_give(bytes) ? nullptr : __libc_memalign(alignment, bytes);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t bytes) {
  if (fails_to_give(bytes)) return ENOMEM;
  *memory = __libc_memalign(alignment, bytes);
  return *memory == nullptr ? ENOMEM : 0;
}

#define OPEN(name)                                                                       \
  int name(const char* file, int flags, ...) {                                           \
    NEXT(name);                                                                          \
    va_list rest;                                                                        \
    va_start(rest, flags);                                                               \
    const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0; \
    va_end(rest);                                                                        \
    return fails(kOpen) ? -1 : next(file, flags, mode);                                  \
  }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                                     \
  int name(int folder, const char* file, int flags, ...) {                               \
    NEXT(name);                                                                          \
    va_list rest;                                                                        \
    va_start(rest, flags);                                                               \
    const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0; \
    va_end(rest);                                                                        \
    return fails(kOpen) ? -1 : next(folder, file, flags, mode);                          \
  }
OPENAT(openat)
OPENAT(openat64)

FILE* fopen(const char* file, const char* mode) {
  NEXT(fopen);
  return fails(kOpen) ? nullptr : next(file, mode);
}
FILE* fopen64(const char* file, const char* mode) {
  NEXT(fopen64);
  return fails(kOpen) ? nullptr : next(file, mode);
}
DIR* opendir(const char* folder) {
  NEXT(opendir);
  return fails(kOpen) ? nullptr : next(folder);
}
int mkdir(const char* folder, mode_t mode) {
  NEXT(mkdir);
  return fails(kOpen) ? -1 : next(folder, mode);
}

ssize_t read(int file, void* into, std::size_t bytes) {
  NEXT(read);
  return moved(kRead, bytes, [&](std::size_t some) { return next(file, into, some); });
}
ssize_t pread(int file, void* into, std::size_t bytes, off_t at) {
  NEXT(pread);
  return moved(kRead, bytes, [&](std::size_t some) { return next(file, into, some, at); });
}
ssize_t pread64(int file, void* into, std::size_t bytes, off64_t at) {
  NEXT(pread64);
  return moved(kRead, bytes, [&](std::size_t some) { return next(file, into, some, at); });
}

ssize_t write(int file, const void* from, std::size_t bytes) {
  NEXT(write);
  if (is_console(file)) return next(file, from, bytes);
  return moved(kWrite, bytes, [&](std::size_t some) { return next(file, from, some); });
}
ssize_t pwrite(int file, const void* from, std::size_t bytes, off_t at) {
  NEXT(pwrite);
  return moved(kWrite, bytes, [&](std::size_t some) { return next(file, from, some, at); });
}
ssize_t pwrite64(int file, const void* from, std::size_t bytes, off64_t at) {
  NEXT(pwrite64);
  return moved(kWrite, bytes, [&](std::size_t some) { return next(file, from, some, at); });
}
ssize_t writev(int file, const iovec* parts, int count) {
  NEXT(writev);
  if (is_console(file)) return next(file, parts, count);
  const Fate fate = meet(kWrite);
  if (fate == Fate::kFail) return -1;
  if (fate == Fate::kPass) return next(file, parts, count);
  const ssize_t written = next(file, parts, count > 1 ? count / 2 : 1);
  if (fate == Fate::kTorn) die();
  return written;
}
std::size_t fwrite(const void* from, std::size_t size, std::size_t count, FILE* stream) {
  NEXT(fwrite);
  if (is_console(stream)) return next(from, size, count, stream);
  if (!fails(kWrite)) return next(from, size, count, stream);
  stream->_flags |= 0x20;  // glibc's: what ferror() tells
  return 0;
}
int fflush(FILE* stream) {
  NEXT(fflush);
  if (stream == nullptr || is_console(stream)) return next(stream);
  if (!fails(kWrite)) return next(stream);
  stream->_flags |= 0x20;
  return EOF;
}

int fsync(int file) {
  NEXT(fsync);
  return fails(kSync) ? -1 : next(file);
}
int fdatasync(int file) {
  NEXT(fdatasync);
  return fails(kSync) ? -1 : next(file);
}

int rename(const char* from, const char* to) {
  NEXT(rename);
  return fails(kRename) ? -1 : next(from, to);
}
int unlink(const char* file) {
  NEXT(unlink);
  return fails(kRename) ? -1 : next(file);
}
int remove(const char* file) {
  NEXT(remove);
  return fails(kRename) ? -1 : next(file);
}
int ftruncate(int file, off_t bytes) {
  NEXT(ftruncate);
  return fails(kRename) ? -1 : next(file, bytes);
}
int ftruncate64(int file, off64_t bytes) {
  NEXT(ftruncate64);
  return fails(kRename) ? -1 : next(file, bytes);
}

void* mmap(void* at, std::size_t bytes, int protection, int flags, int file, off_t offset) {
  NEXT(mmap);
  return fails(kMap) ? MAP_FAILED : next(at, bytes, protection, flags, file, offset);
}
void* mmap64(void* at, std::size_t bytes, int protection, int flags, int file, off64_t offset) {
  NEXT(mmap64);
  return fails(kMap) ? MAP_FAILED : next(at, bytes, protection, flags, file, offset);
}

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*body)(void*),
                   void* argument) {
  NEXT(pthread_create);
  return fails(kThread) ? failure : next(thread, attributes, body, argument);
}

int socket(int domain, int type, int protocol) {
  NEXT(socket);
  return fails(kSocket) ? -1 : next(domain, type, protocol);
}
int bind(int file, const sockaddr* address, socklen_t bytes) {
  NEXT(bind);
  return fails(kSocket) ? -1 : next(file, address, bytes);
}
int listen(int file, int waiting) {
  NEXT(listen);
  return fails(kSocket) ? -1 : next(file, waiting);
}
int accept(int file, sockaddr* address, socklen_t* bytes) {
  NEXT(accept);
  return fails(kSocket) ? -1 : next(file, address, bytes);
}
int accept4(int file, sockaddr* address, socklen_t* bytes, int flags) {
  NEXT(accept4);
  return fails(kSocket) ? -1 : next(file, address, bytes, flags);
}
ssize_t send(int file, const void* from, std::size_t bytes, int flags) {
  NEXT(send);
  return moved(kSocket, bytes, [&](std::size_t some) { return next(file, from, some, flags); });
}
ssize_t recv(int file, void* into, std::size_t bytes, int flags) {
  NEXT(recv);
  return moved(kSocket, bytes, [&](std::size_t some) { return next(file, into, some, flags); });
}
ssize_t sendmsg(int file, const msghdr* message, int flags) {
  NEXT(sendmsg);
  return fails(kSocket) ? -1 : next(file, message, flags);
}
ssize_t recvmsg(int file, msghdr* message, int flags) {
  NEXT(recvmsg);
  return fails(kSocket) ? -1 : next(file, message, flags);
}

int clock_gettime(clockid_t clock, timespec* time) {
  NEXT(clock_gettime);
  const int status = next(clock, time);
  if (clock == CLOCK_REALTIME && status == 0 && fails(kClock)) time->tv_sec -= kSetBack_s;
  return status;
}
int gettimeofday(timeval* time, void* zone) {
  NEXT(gettimeofday);
  const int status = next(time, zone);
  if (status == 0 && fails(kClock)) time->tv_sec -= kSetBack_s;
  return status;
}
time_t time(time_t* into) {
  NEXT(time);
  time_t now = next(nullptr);
  if (fails(kClock)) now -= kSetBack_s;
  if (into != nullptr) *into = now;
  return now;
}

int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*init)(),
                      void (*fini)(), void (*loader_fini)(), void* stack_end) {
  NEXT(__libc_start_main);
  main_of_program = main;
  const auto counted_main = [](int count, char** words, char** environment) {
    level = 0;
    return main_of_program(count, words, environment);
  };
  return next(counted_main, argc, argv, init, fini, loader_fini, stack_end);
}

pid_t fork() {
  NEXT(fork);
  if (fails(kFork)) return -1;
  const pid_t process = next();
  if (process == 0) ++level;
  return process;
}

}  // extern "C"
